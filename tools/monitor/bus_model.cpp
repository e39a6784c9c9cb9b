#include "tools/monitor/bus_model.h"

#include <algorithm>
#include <cmath>

#include "can_dbc/frame/can_frame.h"
#include "can_dbc/text/format.h"
#include "daemon/core/publish/names.h"
#include "daemon/core/publish/own_frames.h"
#include "tools/text/snake_case.h"

namespace beltgrip::monitor {

namespace {

using daemon::MonoTime;

constexpr std::size_t kPointsMost =
    600;  // of a curve, more than cells to show them: then every other goes
constexpr std::size_t kExperimentsKept = 50;
// A silence behind which counters begin anew: the interface was gone, or the daemon starts. Two
// senders are never silent. Chosen: five periods of the message that comes most often.
constexpr daemon::Duration kBeginsAnew = 500 * daemon::kMillisecond;
// Frames that say one result together come within this.
constexpr daemon::Duration kTogether = 50 * daemon::kMillisecond;

std::optional<double> available(const OwnFrameView& frame, const char* signal) {
  if (frame.label(signal) == "NotAvailable") return std::nullopt;
  return frame.value(signal);
}

// The text of the value table, or the number where another version has one more.
std::string name_of(const OwnFrameView& frame, const char* signal) {
  const std::string label = frame.label(signal);
  if (!label.empty()) return text::snake_case(label);
  return format("%.0f (unknown here)", frame.value(signal));
}

template <typename Enum>
Enum value_of(const OwnFrameView& frame, const char* signal) {
  return static_cast<Enum>(frame.value(signal));
}

// Bits of the payload that no signal of the message uses: another version's.
bool has_unknown_bits(const OwnFrameView& view, const can::CanFrame& frame) {
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < daemon::kOwnFrameLength; ++i) {
    bits |= std::uint64_t{frame.data[i]} << (8 * i);
  }
  for (const can::SignalDef& signal : view.message->signals) {
    const std::uint64_t mask = (std::uint64_t{1} << signal.length) - 1;
    bits &= ~(mask << signal.start_bit);
  }
  return bits != 0;
}

}  // namespace

std::string link_text(daemon::BusState link) {
  switch (link) {
    case daemon::BusState::kActive:
      return "up";
    case daemon::BusState::kWarning:
      return "up, controller warns";
    case daemon::BusState::kPassive:
      return "up, controller error passive";
    case daemon::BusState::kOff:
      return "controller bus-off";
    case daemon::BusState::kDown:
      return "interface is down";
    case daemon::BusState::kAbsent:
      return "interface is gone";
  }
  return "";
}

void Rate::add(MonoTime t, double amount) {
  const std::int64_t cell = t.since_origin() / kCell;
  if (!any_) {
    any_ = true;
    first_ = t;
    newest_ = cell;
  }
  for (std::int64_t next = std::max(newest_ + 1, cell - kCells); next <= cell; ++next) {
    sums_[static_cast<std::size_t>(next % (kCells + 1))] = 0.0;
  }
  newest_ = std::max(newest_, cell);
  sums_[static_cast<std::size_t>(cell % (kCells + 1))] += amount;
}

// Of the whole cells before the one that is filling.
double Rate::per_second(MonoTime now) const {
  if (!any_) return 0.0;
  const std::int64_t cell = now.since_origin() / kCell;
  const std::int64_t from = std::max(cell - kCells, first_.since_origin() / kCell);
  if (from >= cell) return 0.0;
  double sum = 0.0;
  for (std::int64_t each = std::max(from, newest_ - kCells); each < cell && each <= newest_;
       ++each) {
    sum += sums_[static_cast<std::size_t>(each % (kCells + 1))];
  }
  return sum * double{can::kSecond_ns} / static_cast<double>(((cell - from) * kCell).ns());
}

int frame_bits(const can::CanFrame& frame) {
  constexpr int kStandard = 47, kExtended = 67;  // ISO 11898-1, classic, with 3 bits of pause
  const int payload = frame.remote ? 0 : 8 * frame.length;
  return (frame.id.extended ? kExtended : kStandard) + payload;
}

BusModel::BusModel(const daemon::FrameIdentifiers& identifiers)
    : identifiers_(identifiers), decoder_(identifiers) {}

bool BusModel::is_own(const can::CanFrame& frame) const {
  if (frame.id.extended || frame.error) return false;
  for (std::size_t i = 0; i < daemon::kOwnMessageCount; ++i) {
    if (frame.id.value == own_identifier(identifiers_, static_cast<daemon::OwnMessage>(i))) {
      return true;
    }
  }
  return false;
}

void BusModel::on_frame(MonoTime t, const can::CanFrame& frame) {
  if (!begun_) begun_ = t;
  if (frame.error) {
    ++traffic_.error_frames;
    return;
  }
  frames_.add(t, 1.0);
  bits_.add(t, frame_bits(frame));
  if (is_own(frame)) on_own_frame(t, frame);
}

void BusModel::distrust(const can::CanFrame& frame, std::uint64_t Distrust::*count,
                        const std::string& why) {
  ++(distrust_.*count);
  distrust_.last = format("0x%X: ", frame.id.value) + why;
}

void BusModel::on_own_frame(MonoTime t, const can::CanFrame& frame) {
  if (!begun_) begun_ = t;
  if (!heard_first_) heard_first_ = t;
  if (heard_ && t - *heard_ > kBeginsAnew) decoder_.begin_anew();
  heard_ = t;
  const std::optional<OwnFrameView> view = decoder_.decode(frame);
  if (!view) {
    return distrust(frame, &Distrust::foreign_version,
                    format("%d bytes%s, not 8: another version, or another node's", frame.length,
                           frame.fd ? " of CAN FD" : ""));
  }
  if (view->check == can::e2e::CheckStatus::kWrongCrc) {
    return distrust(frame, &Distrust::wrong_crc, "wrong CRC");
  }
  if (!view->good()) {
    return distrust(frame, &Distrust::wrong_sequence, "wrong counter: two senders?");
  }
  if (has_unknown_bits(*view, frame)) {
    distrust(frame, &Distrust::foreign_version, "bits that this version does not know");
  }
  const std::string& name = view->message->name;
  if (name == "BeltGripSlip") take_slip(*view);
  if (name == "BeltGripEstimate") take_estimate(t, *view);
  if (name == "BeltGripClamp") take_clamp(*view);
  if (name == "BeltGripStatus") take_status(t, *view);
}

void BusModel::add_point(double sigma_percent, double mu) {
  if (said_.curve.size() >= kPointsMost) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < said_.curve.size(); i += 2) said_.curve[kept++] = said_.curve[i];
    said_.curve.resize(kept);
  }
  said_.curve.push_back({sigma_percent, mu, phase_});
}

void BusModel::take_slip(const OwnFrameView& frame) {
  phase_ = value_of<estimator::Phase>(frame, "Phase");
  said_.phase = name_of(frame, "Phase");
  said_.stop = frame.value("MacroSlipStop") > 0.5;
  said_.mu_star = available(frame, "MuStar");
  said_.sigma_star_percent = available(frame, "SigmaStar");
  said_.friction_slope = available(frame, "FrictionSlope");
  if (!said_.in_experiment || !said_.mu_star || !said_.sigma_star_percent) return;
  sigma_most_percent_ = std::max(sigma_most_percent_, std::abs(*said_.sigma_star_percent));
  // On its way back to the own force the belt is not on its curve.
  if (said_.state != "releasing") add_point(*said_.sigma_star_percent, *said_.mu_star);
}

void BusModel::take_clamp(const OwnFrameView& frame) {
  said_.force_asked_N.reset();
  if (frame.value("RequestActive") > 0.5) said_.force_asked_N = frame.value("SecondaryForce");
}

void BusModel::take_estimate(MonoTime t, const OwnFrameView& frame) {
  said_.friction = {value_of<estimator::PeakKind>(frame, "MuMaxKind"), frame.value("MuMax"),
                    frame.value("MuMaxStd")};
  said_.force_least_N = available(frame, "MinClampForce");
  const double count = frame.value("ExperimentCount");
  said_.experiment_count = static_cast<unsigned>(count);
  if (count_ && *count_ != count && count > 0.0) {
    if (said_.experiments.size() >= kExperimentsKept) {
      said_.experiments.erase(said_.experiments.begin());
    }
    said_.experiments.push_back(
        {t.ns(), said_.outcome, said_.reason, said_.friction, sigma_most_percent_});
    result_since_ = t;
  }
  count_ = count;
}

void BusModel::take_status(MonoTime t, const OwnFrameView& frame) {
  const auto state = value_of<daemon::State>(frame, "State");
  const bool was_in = said_.in_experiment;
  said_.in_experiment = state == daemon::State::kRamping || state == daemon::State::kEvaluating ||
                        state == daemon::State::kReleasing;
  if (said_.in_experiment && !was_in) {
    said_.curve.clear();
    sigma_most_percent_ = 0.0;
  }
  said_.state = name_of(frame, "State");
  said_.outcome = name_of(frame, "Outcome");
  said_.reason = name_of(frame, "StopReason");
  const auto reason = value_of<estimator::StopReason>(frame, "StopReason");
  const bool known = static_cast<std::size_t>(reason) < estimator::kStopReasonCount;
  said_.reason_means = known ? daemon::cause_text(reason, {}) : "";
  if (result_since_ && t - *result_since_ < kTogether && !said_.experiments.empty()) {
    said_.experiments.back().outcome = said_.outcome;
    said_.experiments.back().reason = said_.reason;
  }
  said_.faults.clear();
  for (std::size_t i = 0; i < daemon::kFaultCount; ++i) {
    const std::string name(daemon::kFaults[i].name);
    if (frame.value("Fault" + name) < 0.5) continue;
    said_.faults.push_back(daemon::reason_of(static_cast<daemon::Fault>(i), ""));
  }
}

void BusModel::show(View& view, MonoTime now) const {
  const auto seconds = [&](MonoTime since) {
    return static_cast<double>((now - since).ns()) / double{can::kSecond_ns};
  };
  const std::optional<double> bitrate = view.traffic.bitrate;
  view.traffic = traffic_;
  view.traffic.bitrate = bitrate;
  view.traffic.frames_per_s = frames_.per_second(now);
  view.traffic.bit_per_s = bits_.per_second(now);
  view.silence_s.reset();
  if (heard_) view.silence_s = std::max(0.0, seconds(*heard_));
  if (heard_first_) view.heard_s = seconds(*heard_first_);
  if (begun_) view.listening_s = std::max(view.listening_s, seconds(*begun_));
  view.distrust = distrust_;
  view.state = said_.state;
  view.phase = said_.phase;
  view.outcome = said_.outcome;
  view.reason = said_.reason;
  view.reason_means = said_.reason_means;
  view.in_experiment = said_.in_experiment;
  view.stop = said_.stop;
  view.faults = said_.faults;
  view.mu_star = said_.mu_star;
  view.sigma_star_percent = said_.sigma_star_percent;
  view.friction_slope = said_.friction_slope;
  view.force_asked_N = said_.force_asked_N;
  view.force_least_N = said_.force_least_N;
  view.friction = said_.friction;
  view.experiment_count = said_.experiment_count;
  view.curve = said_.curve;
  view.experiments = said_.experiments;
}

}  // namespace beltgrip::monitor
