#include "tools/monitor/change_lines.h"

#include <algorithm>

#include "can_dbc/frame/can_frame.h"
#include "can_dbc/text/format.h"
#include "can_dbc/text/printable.h"
#include "tools/monitor/layout.h"

namespace beltgrip::monitor {

namespace {

constexpr std::int64_t kDistrustPause_ns = 1'000'000'000;

bool has(const std::vector<Reason>& reasons, const std::string& name) {
  return std::any_of(reasons.begin(), reasons.end(),
                     [&](const Reason& each) { return each.name == name; });
}

std::uint64_t count_of(const Distrust& distrust) {
  return distrust.wrong_crc + distrust.wrong_sequence + distrust.foreign_version;
}

std::string slip_text(const View& view) {
  if (!view.mu_star || !view.sigma_star_percent) return "";
  return format(", mu* %.4f at %.2f %% slip", *view.mu_star, *view.sigma_star_percent);
}

// The phases that are news; that the belt is excited or quiet is not.
bool is_news(const std::string& phase) { return phase == "peak" || phase == "macro_slip"; }

}  // namespace

void ChangeLines::line(const View& view, const std::string& text) {
  constexpr std::int64_t kMicrosecond_ns = 1'000;
  lines_ += format("(%lld.%06lld) ", static_cast<long long>(view.wall_ns / can::kSecond_ns),
                   static_cast<long long>(view.wall_ns % can::kSecond_ns / kMicrosecond_ns)) +
            can::printable(view.source) + " " + can::printable(text) + "\n";
}

void ChangeLines::compare_trust(const View& view) {
  if (view.link != before_.link) line(view, "bus: " + link_text(view.link));
  if (is_silent(view) != is_silent(before_)) {
    line(view, is_silent(view) ? format("no frames for %.0f s: is beltgripd running?", kSilence_s)
                               : std::string("frames of BeltGrip again"));
  }
  const std::uint64_t count = count_of(view.distrust);
  if (count == distrusted_) return;
  // Many come together: then one line a second.
  if (distrust_said_ns_ != 0 && view.wall_ns - distrust_said_ns_ < kDistrustPause_ns) return;
  distrust_said_ns_ = view.wall_ns;
  distrusted_ = count;
  line(view,
       view.distrust.last + format(" (%llu such frames)", static_cast<unsigned long long>(count)));
}

void ChangeLines::compare_reasons(const View& view) {
  for (const Reason& fault : view.faults) {
    if (!has(before_.faults, fault.name)) line(view, "fault " + reason_text(fault));
  }
  for (const Reason& fault : before_.faults) {
    if (!has(view.faults, fault.name)) line(view, "fault " + fault.name + " gone");
  }
  for (const Reason& inhibit : view.inhibits) {
    if (!has(before_.inhibits, inhibit.name)) line(view, "no experiment: " + reason_text(inhibit));
  }
  for (const Reason& inhibit : before_.inhibits) {
    if (!has(view.inhibits, inhibit.name)) line(view, "no longer: " + inhibit.name);
  }
}

void ChangeLines::compare_request(const View& view) {
  if (view.state != before_.state) line(view, "state " + view.state + slip_text(view));
  if (view.force_asked_N.has_value() != before_.force_asked_N.has_value()) {
    line(view, view.force_asked_N ? format("asks for %.0f N", *view.force_asked_N)
                                  : std::string("asks no more"));
  }
  if (view.stop && !before_.stop) line(view, "STOP" + slip_text(view));
  if (!view.stop && before_.stop) line(view, "stop flag cleared");
  if (view.in_experiment && !view.stop && view.phase != before_.phase && is_news(view.phase)) {
    line(view, "phase " + view.phase + slip_text(view));
  }
}

std::string ChangeLines::update(const View& view) {
  compare_trust(view);
  compare_request(view);
  compare_reasons(view);
  if (view.outcome != before_.outcome || view.reason != before_.reason) {
    if (view.outcome != "none" && view.outcome != "-") {
      line(view, "outcome " + view.outcome + " (" + view.reason + ": " + view.reason_means + ")");
    }
  }
  if (view.friction.mu_max != before_.friction.mu_max ||
      view.friction.kind != before_.friction.kind) {
    std::string text = "mu_max " + friction_text(view.friction);
    if (view.force_least_N) text += format(", least clamp %.0f N", *view.force_least_N);
    line(view, text);
  }
  before_ = view;
  return std::move(lines_);
}

}  // namespace beltgrip::monitor
