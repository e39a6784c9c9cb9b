#include "tests/statistics/blind/blind_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <map>
#include <optional>

namespace beltgrip::blind {
namespace {

using nlohmann::json;

// Counts with the 95 % Clopper-Pearson interval.
struct Share {
  int hits = 0, all = 0;
  void add(bool hit) {
    hits += hit ? 1 : 0;
    ++all;
  }
};

double binomial_tail(int n, int k, double p) {  // P(X >= k)
  double sum = 0.0;
  for (int i = k; i <= n; ++i) {
    sum +=
        std::exp(std::lgamma(n + 1.0) - std::lgamma(i + 1.0) - std::lgamma(n - i + 1.0) +
                 i * std::log(std::max(p, 1e-300)) + (n - i) * std::log(std::max(1.0 - p, 1e-300)));
  }
  return sum;
}

std::string text(const Share& share) {
  if (share.all == 0) return "-";
  const auto solve = [&](auto&& above) {
    double low = 0.0, high = 1.0;
    for (int i = 0; i < 50; ++i) {
      const double middle = 0.5 * (low + high);
      (above(middle) ? high : low) = middle;
    }
    return low;
  };
  const double low = share.hits == 0 ? 0.0 : solve([&](double p) {
    return binomial_tail(share.all, share.hits, p) > 0.025;
  });
  const double high = share.hits == share.all ? 1.0 : solve([&](double p) {
    return 1.0 - binomial_tail(share.all, share.hits + 1, p) < 0.025;
  });
  char buffer[96];
  std::snprintf(buffer, sizeof buffer, "%5.1f %% [%4.1f, %5.1f] (%d/%d)",
                100.0 * share.hits / share.all, 100.0 * low, 100.0 * high, share.hits, share.all);
  return buffer;
}

void line(std::string& out, const char* format, ...) __attribute__((format(printf, 2, 3)));
void line(std::string& out, const char* format, ...) {
  char buffer[512];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(buffer, sizeof buffer, format, arguments);
  va_end(arguments);
  out += buffer;
  out += "\n";
}

bool answers(const json& finding, const std::string& effect, bool with_aliases) {
  if (finding.at("effect") == effect) return true;
  if (!with_aliases) return false;
  const auto& aliases = finding.at("aliases");
  return std::find(aliases.begin(), aliases.end(), effect) != aliases.end();
}

// Of what the true structure, fitted, removes from the error on experiments left out: the tool's
// share, in the signal where most can be removed. None where hardly any can.
std::optional<double> share_removed(const json& entry) {
  constexpr double kRemovable = 0.05;  // of the error
  std::optional<double> out;
  double most = kRemovable;
  const json all = entry.value("removable", json::object());
  for (const auto& [name, removable] : all.items()) {
    const double before = removable.at(0), oracle = removable.at(1);
    if (!entry.at("gain").contains(name) || before - oracle < most * before) continue;
    most = 1.0 - oracle / before;
    out = (before - entry.at("gain").at(name).at(1).get<double>()) / (before - oracle);
  }
  return out;
}

}  // namespace

std::string table_text(const std::vector<json>& entries) {
  std::string out;
  constexpr std::array<double, 7> kBins{0.0, 4.0, 6.0, 8.0, 12.0, 20.0, 1e9};
  std::array<Share, 6> named, in_class, detected;
  std::array<double, 6> oracle_sum{};
  std::array<int, 6> class_size{};
  Share clear_named, clear_class, covered, false_alarm, false_alarm_paper, stress_alarm;
  Share pair_both, pair_wrong, unknown_flagged, unknown_clean, by_correlation, by_error;
  Share rival_alarm_correlation, rival_alarm_error, single_extra, removed;
  std::map<std::string, Share> by_effect;
  std::map<std::string, std::map<std::string, int>> confusion;
  std::vector<double> seconds, shares_removed;
  for (const json& entry : entries) {
    const std::string kind = entry.at("kind");
    const json& findings = entry.at("findings");
    const json& truth = entry.at("truth");
    const bool alarm = !findings.empty() || entry.contains("unknown");
    seconds.push_back(entry.at("tool_s"));
    const json& rivals = entry.at("rivals");
    if (kind == "nothing") {
      (entry.at("paper_plan").get<bool>() ? false_alarm_paper : false_alarm).add(alarm);
      rival_alarm_correlation.add(rivals.at("correlation") != "");
      rival_alarm_error.add(rivals.at("error") != "");
    }
    if (kind == "stress") stress_alarm.add(alarm);
    if (kind == "single") {
      const json& only = truth.at(0);
      const std::string effect = only.at("effect");
      if (!only.contains("d")) continue;
      const double d = only.at("d"), ceiling = only.at("oracle");
      std::size_t bin = 0;
      while (d >= kBins[bin + 1]) ++bin;
      const bool right = !findings.empty() && answers(findings.at(0), effect, false);
      bool any_class = false;
      for (const json& each : findings) any_class |= answers(each, effect, true);
      named[bin].add(right);
      in_class[bin].add(any_class);
      detected[bin].add(alarm);
      oracle_sum[bin] += ceiling;
      if (!findings.empty())
        class_size[bin] += 1 + static_cast<int>(findings.at(0).at("aliases").size());
      if (ceiling >= 0.95) {
        clear_named.add(right);
        clear_class.add(any_class);
        by_effect[effect].add(right);
        if (const auto share = share_removed(entry)) {
          shares_removed.push_back(*share);
          removed.add(*share >= 0.8);
        }
        by_correlation.add(rivals.at("correlation") == effect);
        by_error.add(rivals.at("error") == effect);
        single_extra.add(findings.size() > 1 || entry.contains("unknown"));
        const std::string answer = findings.empty()
                                       ? (entry.contains("unknown") ? "(unknown)" : "(nothing)")
                                       : findings.at(0).at("effect").get<std::string>();
        confusion[effect][answer] += 1;
      }
      if (right && only.contains("slot") && findings.at(0).at("slot") == only.at("slot")) {
        const double t =
            (findings.at(0).at("value").get<double>() - only.at("value").get<double>()) /
            findings.at(0).at("sigma").get<double>();
        const double degrees = findings.at(0).at("degrees");
        // Student's 97.5 % quantile, Cornish-Fisher.
        const double z = 1.95996;
        const double bound =
            z + (z * z * z + z) / (4.0 * degrees) +
            (5.0 * std::pow(z, 5.0) + 16.0 * z * z * z + 3.0 * z) / (96.0 * degrees * degrees);
        covered.add(std::abs(t) < bound);
      }
    }
    if (kind == "pair") {
      bool clear = true;
      for (const json& each : truth)
        clear &= each.contains("d") && each.at("oracle").get<double>() >= 0.95;
      if (!clear) continue;
      bool both = true, wrong = false;
      for (const json& each : truth) {
        bool found = false;
        for (const json& finding : findings) found |= answers(finding, each.at("effect"), true);
        both &= found;
      }
      for (const json& finding : findings) {
        bool found = false;
        for (const json& each : truth) found |= answers(finding, each.at("effect"), true);
        wrong |= !found;
      }
      pair_both.add(both);
      pair_wrong.add(wrong);
    }
    if (kind == "unknown") {
      unknown_flagged.add(entry.contains("unknown"));
      unknown_clean.add(findings.empty());
    }
  }
  line(out, "trials: %zu", entries.size());
  line(out, "single effects by size d (sigmas after refitting the machine)");
  line(out, "%-10s %-32s %-9s %-32s %-32s %s", "d", "named first", "oracle", "inside the class",
       "alarm", "class size");
  for (std::size_t bin = 0; bin < named.size(); ++bin) {
    if (named[bin].all == 0) continue;
    char range[32];
    std::snprintf(
        range, sizeof range, "%g-%s", kBins[bin],
        bin + 2 < kBins.size() ? std::to_string(static_cast<int>(kBins[bin + 1])).c_str() : "");
    line(out, "%-10s %-32s %5.1f %%   %-32s %-32s %.2f", range, text(named[bin]).c_str(),
         100.0 * oracle_sum[bin] / named[bin].all, text(in_class[bin]).c_str(),
         text(detected[bin]).c_str(),
         static_cast<double>(class_size[bin]) / std::max(1, detected[bin].hits));
  }
  line(out, "where the oracle reaches 95 %%:");
  line(out, "  named first                 %s", text(clear_named).c_str());
  line(out, "  inside the answer's class   %s", text(clear_class).c_str());
  line(out, "  something beside it         %s", text(single_extra).c_str());
  line(out, "  rival, largest correlation  %s", text(by_correlation).c_str());
  line(out, "  rival, smallest error       %s", text(by_error).c_str());
  line(out, "  pairs, both named           %s", text(pair_both).c_str());
  line(out, "  pairs, with a wrong name    %s", text(pair_wrong).c_str());
  line(out, "false alarm, varied plans     %s", text(false_alarm).c_str());
  line(out, "false alarm, equal ramps      %s", text(false_alarm_paper).c_str());
  line(out, "false alarm under stress      %s", text(stress_alarm).c_str());
  line(out, "  rival, largest correlation  %s", text(rival_alarm_correlation).c_str());
  line(out, "  rival, smallest error       %s", text(rival_alarm_error).c_str());
  line(out, "unknown, flagged              %s", text(unknown_flagged).c_str());
  line(out, "unknown, not misnamed         %s", text(unknown_clean).c_str());
  line(out, "parameter inside its 95 %%     %s", text(covered).c_str());
  if (!shares_removed.empty()) {
    std::sort(shares_removed.begin(), shares_removed.end());
    line(out, "  80 %% of the removable error  %s, median %.0f %%", text(removed).c_str(),
         100.0 * shares_removed[shares_removed.size() / 2]);
  }
  if (!seconds.empty()) {
    std::sort(seconds.begin(), seconds.end());
    line(out, "processor time: median %.2f s, 90 %% %.2f s", seconds[seconds.size() / 2],
         seconds[seconds.size() * 9 / 10]);
  }
  line(out, "by effect, where the oracle reaches 95 %%:");
  for (const auto& [effect, share] : by_effect) {
    std::string answers_text;
    for (const auto& [answer, count] : confusion[effect]) {
      if (answer != effect) answers_text += " " + answer + ":" + std::to_string(count);
    }
    line(out, "  %-22s %s%s%s", effect.c_str(), text(share).c_str(),
         answers_text.empty() ? "" : "  else", answers_text.c_str());
  }
  return out;
}

}  // namespace beltgrip::blind
