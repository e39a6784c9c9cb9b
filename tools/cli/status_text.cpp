#include "tools/cli/status_text.h"

#include <cstdint>

#include "can_dbc/text/format.h"
#include "can_dbc/text/number_text.h"
#include "can_dbc/text/printable.h"
#include "daemon/core/reasons/reasons.h"

namespace beltgrip::cli {

namespace {

using Json = nlohmann::ordered_json;

std::string list(const Json& names) {
  std::string text;
  for (const auto& each : names) text += (text.empty() ? "" : ", ") + each.get<std::string>();
  return text.empty() ? "none" : text;
}

std::string number(const Json& value, const char* format) {
  return value.is_number() ? beltgrip::format(format, value.get<double>()) : "-";
}

std::string state_text(const Json& status) {
  return status.at("state").get<std::string>() + ", " + status.at("phase").get<std::string>() +
         (status.at("macro_slip_stop").get<bool>() ? ", STOP" : "");
}

std::string outcome_text(const Json& result) {
  if (result.is_null()) return "none yet";
  std::string text =
      result.at("outcome").get<std::string>() + ", " + result.at("stop_reason").get<std::string>();
  if (const Json& bound = result.at("mu_max_lower_bound"); bound.is_number()) {
    return text + ", mu_max at least " + number(bound, "%.4f");
  }
  return text + ", mu_max " + number(result.at("mu_max"), "%.4f") + " +- " +
         number(result.at("mu_max_std"), "%.4f");
}

std::string result_text(const Json& result) {
  if (result.is_null()) return outcome_text(result);
  std::string text = outcome_text(result) + ", " + number(result.at("age_s"), "%.0f s ago");
  if (result.at("mu_max").is_number()) return text;
  if (const auto reason = result.at("reason").get<std::string>(); !reason.empty()) {
    text += ": " + reason;
  }
  const auto remedy = result.at("remedy").get<std::string>();
  return remedy.empty() ? text : text + "; to do: " + remedy;
}

// Of one direction and end stop, from "carried".
std::string carried_text(const Json& one) {
  if (!one.at("mu_max_lower_bound").is_number()) {
    return "mu* " + number(one.at("impossible_mu_star"), "%.3f") +
           " is read where the belt holds: more than any belt has";
  }
  std::string text = "mu_max at least " + number(one.at("mu_max_lower_bound"), "%.4f") +
                     ", carried without slip at " + number(one.at("torque_Nm"), "%.0f Nm") + ", " +
                     number(one.at("clamp_force_N"), "%.0f N");
  if (const Json& share = one.at("reserve_share"); share.is_number()) {
    text += "; of the force " + number(share.get<double>() * 100.0, "%.0f %%") +
            " and more was reserve";
  }
  return text;
}

// A label's value between quotes.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c == '\n' ? ' ' : c;
  }
  return out + "\"";
}

// The samples of one metric after the other, each metric with its head.
class Metrics {
 public:
  explicit Metrics(const std::string& interface) : label_("interface=" + quoted(interface)) {}

  void head(const char* name, const char* type, const char* help) {
    name_ = std::string("beltgrip_") + name;
    out_ += "# HELP " + name_ + " " + help + "\n# TYPE " + name_ + " " + type + "\n";
  }
  // Nothing where there is no value.
  void sample(const Json& value, const std::string& labels = {}, double scale = 1.0) {
    if (!value.is_number()) return;
    out_ += name_ + "{" + label_ + (labels.empty() ? "" : "," + labels) + "} " +
            number_text(value.get<double>() * scale) + '\n';
  }
  const std::string& text() const { return out_; }

 private:
  std::string label_, name_, out_;
};

constexpr double kMicrosecond_s = 1e-6;

}  // namespace

std::string status_text(const Json& status) {
  std::string out;
  const auto line = [&out](const std::string& name, const std::string& text) {
    out += can::printable(name) + std::string(name.size() < 16 ? 16 - name.size() : 0, ' ') + " " +
           can::printable(text) + "\n";
  };
  line("interface",
       status.at("interface").get<std::string>() + ", " + status.at("control").get<std::string>());
  line("state", state_text(status));
  line("faults", list(status.at("faults")));
  line("inhibits", list(status.at("inhibits")));
  for (const auto& why : status.at("why")) {
    const auto text = [&](const char* key) { return why.at(key).get<std::string>(); };
    line("why", daemon::reason_text({text("name"), text("means"), text("figure"), text("remedy")}));
  }
  line("last result", result_text(status.at("result")));
  for (const auto& one : status.at("carried")) {
    line(one.at("direction").get<std::string>() + ", " + one.at("ratio").get<std::string>(),
         carried_text(one));
  }
  for (const auto& [role, signal] : status.at("signals").items()) {
    line(role, number(signal.at("value"), "%.6g") + " " + signal.at("unit").get<std::string>() +
                   ", " + signal.at("quality").get<std::string>() +
                   number(signal.at("since_s"), " for %.3g s") + ", " +
                   number(signal.at("age_s"), "%.3f s old"));
  }
  for (const auto& [name, latency] : status.at("latency").items()) {
    line(name, "p50 " + number(latency.at("p50_us"), "%.0f us") + ", p99 " +
                   number(latency.at("p99_us"), "%.0f us") + ", p99.9 " +
                   number(latency.at("p999_us"), "%.0f us") + ", worst " +
                   number(latency.at("max_us"), "%.0f us"));
  }
  for (const auto& [name, count] : status.at("counters").items()) {
    line(name, std::to_string(count.get<std::uint64_t>()));
  }
  return out;
}

std::string status_line(const Json& status) {
  return can::printable(state_text(status) + "; faults: " + list(status.at("faults")) +
                        "; inhibits: " + list(status.at("inhibits")) +
                        "; last result: " + outcome_text(status.at("result")));
}

std::string status_metrics(const Json& status, const std::string& interface) {
  Metrics metrics(interface);
  metrics.head("up", "gauge", "1 if beltgripd answers");
  metrics.sample(status.is_null() ? 0 : 1);
  if (status.is_null()) return metrics.text();
  if (const Json& result = status.at("result"); !result.is_null()) {
    metrics.head("mu_max", "gauge", "Maximum traction coefficient, last result if it is a value");
    metrics.sample(result.at("mu_max"));
    metrics.head("mu_max_std", "gauge", "Its standard deviation");
    metrics.sample(result.at("mu_max_std"));
    metrics.head("mu_max_lower_bound", "gauge", "Last result if it is a lower bound only");
    metrics.sample(result.at("mu_max_lower_bound"));
    metrics.head("result_age_seconds", "gauge", "Time since the last result");
    metrics.sample(result.at("age_s"));
  }
  const auto carried = [&](const char* name, const char* key, const char* help) {
    metrics.head(name, "gauge", help);
    for (const auto& one : status.at("carried")) {
      metrics.sample(one.at(key), "direction=" + quoted(one.at("direction").get<std::string>()) +
                                      ",ratio=" + quoted(one.at("ratio").get<std::string>()));
    }
  };
  carried("carried_mu_max_lower_bound", "mu_max_lower_bound",
          "What mu_max is at least, as so much was carried without slip");
  carried("carried_reserve_share", "reserve_share",
          "Share of the clamping force that was reserve against it, at least");
  metrics.head("macro_slip_stop", "gauge", "1 while the flag is set");
  metrics.sample(status.at("macro_slip_stop").get<bool>() ? 1 : 0);
  metrics.head("state", "gauge", "1 for the state of the experiment");
  metrics.sample(1, "state=" + quoted(status.at("state").get<std::string>()));
  metrics.head("fault", "gauge", "1 for each fault that stands");
  for (const auto& fault : status.at("faults")) {
    metrics.sample(1, "fault=" + quoted(fault.get<std::string>()));
  }
  metrics.head("inhibit", "gauge", "1 for each reason why no experiment begins");
  for (const auto& inhibit : status.at("inhibits")) {
    metrics.sample(1, "inhibit=" + quoted(inhibit.get<std::string>()));
  }
  metrics.head("signal_age_seconds", "gauge", "Age of each role's signal");
  for (const auto& [role, signal] : status.at("signals").items()) {
    metrics.sample(signal.at("age_s"), "role=" + quoted(role) + ",quality=" +
                                           quoted(signal.at("quality").get<std::string>()));
  }
  for (const auto& [name, count] : status.at("counters").items()) {
    metrics.head((name + "_total").c_str(), "counter", "Since the start");
    metrics.sample(count);
  }
  metrics.head("latency_seconds", "gauge", "Quantiles since the start");
  for (const auto& [name, latency] : status.at("latency").items()) {
    for (const auto& [key, quantile] :
         {std::pair{"p50_us", "0.5"}, std::pair{"p99_us", "0.99"}, std::pair{"p999_us", "0.999"}}) {
      metrics.sample(latency.at(key), "path=" + quoted(name) + ",quantile=" + quoted(quantile),
                     kMicrosecond_s);
    }
  }
  return metrics.text();
}

}  // namespace beltgrip::cli
