#include "daemon/core/observe/carried_window.h"

#include <algorithm>
#include <cmath>

#include "daemon/core/experiment/arming.h"
#include "estimator/physics/units.h"

namespace beltgrip::daemon {

namespace {

// With one of these the inputs, or what is read of them, are not what they seem.
constexpr std::uint32_t kMisread = fault_bit(Fault::kInputMissing) | fault_bit(Fault::kInputStale) |
                                   fault_bit(Fault::kInputFrozen) | fault_bit(Fault::kInputRange) |
                                   fault_bit(Fault::kInputNotFinite) |
                                   fault_bit(Fault::kInputFrame) | fault_bit(Fault::kTimeStamp) |
                                   fault_bit(Fault::kInputRate) |
                                   fault_bit(Fault::kInputProtection);

bool holds(const SampleReport& report) noexcept {
  const estimator::CurveEstimate& curve = report.curve;
  const double sign = curve.direction == estimator::Direction::kDrive ? 1.0 : -1.0;
  return report.sample.usable && curve.usable && report.torque_is_the_belts &&
         (report.faults & kMisread) == 0 && curve.clamp_force_N > 0.0 &&
         std::isfinite(curve.mu_star) &&
         Arming::rests_on_stop(1.0 - sign * curve.sigma_star_percent / estimator::kPercent,
                               curve.clamp_force_N);
}

}  // namespace

void CarriedWatch::Sums::add(const Sums& other) noexcept {
  samples += other.samples;
  mu_star += other.mu_star;
  sigma_percent += other.sigma_percent;
  clamp_force_N += other.clamp_force_N;
  torque_Nm += other.torque_Nm;
  omega_p_rad_s += other.omega_p_rad_s;
  omega_s_rad_s += other.omega_s_rad_s;
}

void CarriedWatch::restart(const SampleReport& report) noexcept {
  blocks_ = 0;
  block_ = halves_[0] = halves_[1] = {};
  lowered_ = false;
  lowest_ = std::numeric_limits<double>::infinity();
  block_since_ = report.t;
}

const CarriedWindow* CarriedWatch::step(const SampleReport& report) noexcept {
  if (!holds(report)) {
    runs_ = false;
    return nullptr;
  }
  const estimator::CurveEstimate& curve = report.curve;
  const bool goes_on = runs_ && report.t - last_ < kBlock && report.t >= last_ &&
                       curve.direction == window_.direction && curve.end_stop == window_.end_stop;
  if (!goes_on) {
    restart(report);
    runs_ = true;
    window_.direction = curve.direction;
    window_.end_stop = curve.end_stop;
  }
  last_ = report.t;
  lowered_ = lowered_ ||
             (commands_ && (report.state == State::kRamping || report.state == State::kReleasing));
  const bool complete = report.t - block_since_ >= kBlock && end_block(report);
  block_.add({1.0, curve.mu_star, curve.sigma_star_percent, curve.clamp_force_N, curve.torque_p_Nm,
              report.sample.omega_p_rad_s, report.sample.omega_s_rad_s});
  return complete ? &window_ : nullptr;
}

// The block before this sample. True: with it a window is complete in which slip did not grow.
bool CarriedWatch::end_block(const SampleReport& report) noexcept {
  const double mu_star = block_.mu_star / block_.samples;
  const double omega_p_rad_s = block_.omega_p_rad_s / block_.samples;
  if (blocks_ == 0) omega_p_first_rad_s_ = omega_p_rad_s;
  lowest_ = std::min(lowest_, mu_star);
  halves_[blocks_ < kBlocks / 2 ? 0 : 1].add(block_);
  block_ = {};
  block_since_ = report.t;
  if (++blocks_ < kBlocks) return false;
  const double growth_percent =
      halves_[1].sigma_percent / halves_[1].samples - halves_[0].sigma_percent / halves_[0].samples;
  Sums all = halves_[0];
  all.add(halves_[1]);
  constexpr double kBetween_s = seconds(kWindow - kBlock);
  window_.end = report.t;
  window_.mu_star_held = lowest_;
  window_.mu_star = all.mu_star / all.samples;
  window_.clamp_force_N = all.clamp_force_N / all.samples;
  window_.torque_Nm = all.torque_Nm / all.samples;
  window_.omega_p_rad_s = all.omega_p_rad_s / all.samples;
  window_.omega_s_rad_s = all.omega_s_rad_s / all.samples;
  window_.acceleration_rad_s2 = (omega_p_rad_s - omega_p_first_rad_s_) / kBetween_s;
  window_.oil_degC = report.oil_degC;
  window_.lowered = lowered_;
  restart(report);
  return window_.mu_star_held > 0.0 && growth_percent <= kSlipGrowth_percent;
}

}  // namespace beltgrip::daemon
