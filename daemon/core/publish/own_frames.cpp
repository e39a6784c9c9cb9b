#include "daemon/core/publish/own_frames.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <span>
#include <string>

#include "beltgrip_dbc_text.h"
#include "can_dbc/dbc/parser.h"
#include "can_dbc/frame/e2e.h"

namespace beltgrip::daemon {

namespace {

constexpr std::array<const char*, kOwnMessageCount> kMessageNames{
    "BeltGripEstimate", "BeltGripSlip", "BeltGripClamp", "BeltGripStatus"};

double code(bool flag) { return flag ? 1.0 : 0.0; }
template <typename Enum>
double code(Enum value) {
  return static_cast<double>(static_cast<unsigned>(value));
}

}  // namespace

std::uint32_t own_identifier(const FrameIdentifiers& identifiers, OwnMessage message) noexcept {
  switch (message) {
    case OwnMessage::kEstimate:
      return identifiers.estimate;
    case OwnMessage::kSlip:
      return identifiers.slip;
    case OwnMessage::kClamp:
      return identifiers.clamp;
    case OwnMessage::kStatus:
      break;
  }
  return identifiers.status;
}

std::string_view beltgrip_dbc_text() { return kBeltgripDbcText; }

const can::Database& own_database() {
  static const can::Database database = [] {
    can::DbcParseResult parsed = can::parse_dbc(std::string(beltgrip_dbc_text()));
    assert(parsed.problems.empty());
    return std::move(parsed.database);
  }();
  return database;
}

OwnFrames::Field OwnFrames::field(OwnMessage message, std::string_view signal) {
  const can::MessageDef* found =
      own_database().find_message(kMessageNames[static_cast<std::size_t>(message)]);
  assert(found != nullptr);
  const can::SignalDef* definition = found->find_signal(std::string(signal));
  assert(definition != nullptr);
  Field result{can::SignalCodec(*definition), definition->scale, definition->usage->minimum,
               definition->usage->maximum, 0};
  for (const auto& [raw, text] : definition->values) {
    if (text == "NotAvailable") result.not_available = static_cast<std::uint64_t>(raw);
  }
  return result;
}

OwnFrames::OwnFrames(const FrameIdentifiers& identifiers) : identifiers_(identifiers) {
  constexpr OwnMessage kE = OwnMessage::kEstimate;
  estimate_ = {field(kE, "MuMaxKind"), field(kE, "MuMaxValid"),      field(kE, "MuMax"),
               field(kE, "MuMaxStd"),  field(kE, "ExperimentCount"), field(kE, "MinClampForce")};
  constexpr OwnMessage kL = OwnMessage::kSlip;
  slip_ = {field(kL, "MacroSlipStop"), field(kL, "Phase"), field(kL, "MuStar"),
           field(kL, "SigmaStar"), field(kL, "FrictionSlope")};
  clamp_ = {field(OwnMessage::kClamp, "RequestActive"),
            field(OwnMessage::kClamp, "SecondaryForce")};
  constexpr OwnMessage kS = OwnMessage::kStatus;
  status_.state = field(kS, "State");
  status_.outcome = field(kS, "Outcome");
  status_.reason = field(kS, "StopReason");
  for (std::size_t i = 0; i < kFaultCount; ++i) {
    status_.faults[i] = field(kS, "Fault" + std::string(kFaults[i].name));
  }
}

void OwnFrames::put(can::CanFrame& frame, const Field& field, double value) noexcept {
  field.codec.encode(std::span(frame.data.data(), frame.length),
                     std::clamp(value, field.minimum, field.maximum));
}

void OwnFrames::put_or_not_available(can::CanFrame& frame, const Field& field, bool available,
                                     double value) noexcept {
  if (available && std::isfinite(value)) {
    put(frame, field, value);
  } else {
    field.codec.insert(std::span(frame.data.data(), frame.length), field.not_available);
  }
}

void OwnFrames::put_rounded_up(can::CanFrame& frame, const Field& field, double value) noexcept {
  put(frame, field, std::ceil(value / field.scale) * field.scale);
}

can::CanFrame OwnFrames::empty(OwnMessage message) const noexcept {
  can::CanFrame frame;
  frame.id = {own_identifier(identifiers_, message), false};
  frame.length = kOwnFrameLength;
  return frame;
}

can::CanFrame OwnFrames::pack(const EstimateValues& values, std::uint8_t counter) const noexcept {
  using estimator::PeakKind;
  const bool sane = std::isfinite(values.mu_max) && values.mu_max > 0.0 &&
                    (values.kind != PeakKind::kValue ||
                     (std::isfinite(values.mu_max_std) && values.mu_max_std > 0.0));
  const PeakKind kind = sane ? values.kind : PeakKind::kNone;
  const bool value = kind == PeakKind::kValue;
  can::CanFrame frame = empty(OwnMessage::kEstimate);
  put(frame, estimate_.kind, code(kind));
  put(frame, estimate_.valid, code(value));
  put(frame, estimate_.mu_max, kind == PeakKind::kNone ? 0.0 : values.mu_max);
  put_rounded_up(frame, estimate_.mu_max_std, value ? values.mu_max_std : 0.0);
  put(frame, estimate_.count, values.experiment_count);
  if (values.min_clamp_force_N && std::isfinite(*values.min_clamp_force_N)) {
    put_rounded_up(frame, estimate_.min_force, *values.min_clamp_force_N);
  } else {
    put_or_not_available(frame, estimate_.min_force, false, 0.0);
  }
  can::e2e::protect(frame, own_data_id(OwnMessage::kEstimate), counter);
  return frame;
}

can::CanFrame OwnFrames::pack(const SlipValues& values, std::uint8_t counter) const noexcept {
  can::CanFrame frame = empty(OwnMessage::kSlip);
  put(frame, slip_.stop, code(values.macro_slip_stop));
  put(frame, slip_.phase, code(values.phase));
  put_or_not_available(frame, slip_.mu_star, values.available, values.mu_star);
  put_or_not_available(frame, slip_.sigma_star, values.available, values.sigma_star_percent);
  put_or_not_available(frame, slip_.slope, values.available, values.friction_slope);
  can::e2e::protect(frame, own_data_id(OwnMessage::kSlip), counter);
  return frame;
}

can::CanFrame OwnFrames::pack(const ClampValues& values, std::uint8_t counter) const noexcept {
  can::CanFrame frame = empty(OwnMessage::kClamp);
  const bool active = values.request_active && std::isfinite(values.secondary_force_N);
  put(frame, clamp_.active, code(active));
  put(frame, clamp_.force, active ? values.secondary_force_N : 0.0);
  can::e2e::protect(frame, own_data_id(OwnMessage::kClamp), counter);
  return frame;
}

can::CanFrame OwnFrames::pack(const StatusValues& values, std::uint8_t counter) const noexcept {
  can::CanFrame frame = empty(OwnMessage::kStatus);
  put(frame, status_.state, code(values.state));
  put(frame, status_.outcome, code(values.outcome));
  put(frame, status_.reason, code(values.stop_reason));
  for (std::size_t i = 0; i < kFaultCount; ++i) {
    put(frame, status_.faults[i], code((values.faults >> i & 1U) != 0));
  }
  can::e2e::protect(frame, own_data_id(OwnMessage::kStatus), counter);
  return frame;
}

}  // namespace beltgrip::daemon
