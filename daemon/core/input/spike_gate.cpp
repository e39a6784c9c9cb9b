#include "daemon/core/input/spike_gate.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace beltgrip::daemon {

namespace {
constexpr double kTimesUsual = 5.5;
constexpr double kSteps = 4.0;        // of the signal's resolution, at least
constexpr double kShare = 1e-3;       // of the value, at least: too little to matter
constexpr double kPerMissing = 0.25;  // of the bound
constexpr double kNoNoise = 1.5;      // times the bound: a spike for sure
constexpr double kEnough = 30.0;      // values before anything is left out
constexpr double kRemembered = 50.0;
constexpr double kLargest = 4.0;  // distance counted for what is usual, of what is
}  // namespace

void SpikeGate::reset() noexcept {
  filled_ = left_out_ = 0;
  furthest_ = 0.0;
  usual_ = learned_ = 0.0;
  bound_ = 0.0;
}

estimator::ReadingStatus SpikeGate::status() const noexcept {
  if (bound_ <= 0.0) return {};
  // The mean distance of what is normally distributed is sqrt(2 / pi) of its deviation.
  return {.value = value_,
          .expected = expected_,
          .variance = 0.5 * std::numbers::pi * usual_ * usual_,
          .test_ratio = std::abs(value_ - expected_) / bound_};
}

// Least squares.
double SpikeGate::ahead(double steps) const noexcept {
  constexpr double kMiddle = 0.5 * (kLine - 1);
  constexpr double kMoment = kLine * (kLine * kLine - 1) / 12.0;
  // Mean and slope side by side: one division for both.
  using Two [[gnu::vector_size(2 * sizeof(double))]] = double;
  constexpr Two kParts{kLine, kMoment};
  Two sum{};
  for (std::size_t i = 0; i < kLine; ++i) {
    sum += Two{line_[i], line_[i] * (static_cast<double>(i) - kMiddle)} / kParts;
  }
  return sum[0] + sum[1] * (kMiddle + steps);
}

void SpikeGate::push(double value) noexcept {
  std::copy(line_.begin() + 1, line_.end(), line_.begin());
  line_.back() = value;
  filled_ = std::min(filled_ + 1, kLine);
}

SpikeGate::Verdict SpikeGate::judge(double value, std::size_t most) noexcept {
  bound_ = 0.0;
  if (filled_ < kLine) {
    push(value);
    return Verdict::kTaken;
  }
  const double steps = static_cast<double>(left_out_ + 1);
  value_ = value;
  expected_ = ahead(steps);
  const double distance = std::abs(value - expected_);
  // The line grows less certain with every value that is missing.
  const double bound = std::max({kTimesUsual * usual_, kSteps * step_, kShare * std::abs(value)}) *
                       (1.0 + kPerMissing * (steps - 1.0));
  if (learned_ >= kEnough) bound_ = bound;
  if (learned_ >= kEnough && distance > bound) {
    if (left_out_ < most) {
      ++left_out_;
      furthest_ = std::max(furthest_, distance / bound);
      return Verdict::kLeftOut;
    }
    // It stays away: the course has changed, and begins anew. More of that is to be expected.
    usual_ = std::max(usual_, distance / kTimesUsual);
    filled_ = left_out_ = 0;
    furthest_ = 0.0;
    push(value);
    return Verdict::kTaken;
  }
  learned_ = std::min(learned_ + 1.0, kRemembered);
  const double counted =
      learned_ < kEnough ? distance : std::min(distance, kLargest * usual_ + step_);
  usual_ += (counted - usual_) / learned_;
  const bool after_spike = furthest_ > kNoNoise;
  const double before = line_.back();
  for (std::size_t i = 1; i <= left_out_; ++i) {
    push(before + (value - before) * static_cast<double>(i) / steps);
  }
  left_out_ = 0;
  furthest_ = 0.0;
  push(value);
  return after_spike ? Verdict::kTakenAfterSpike : Verdict::kTaken;
}

}  // namespace beltgrip::daemon
