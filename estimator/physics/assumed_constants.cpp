#include "estimator/physics/assumed_constants.h"

#include <algorithm>
#include <cmath>

#include "estimator/statistics/interval.h"

namespace beltgrip::estimator {

namespace {

constexpr std::array<Assumption, kConstantCount> kAssumptions{{
    {"primary_radius_overdrive_m", &VariatorParameters::primary_radius_overdrive_m, false, 0.075,
     0.082, "m",
     "running radius of the belt on the primary pulley at the overdrive stop: from belt length, "
     "centre distance and end-stop ratio, or measured with the cover off"},
    {"primary_radius_low_m", &VariatorParameters::primary_radius_low_m, false, 0.030, 0.035, "m",
     "the same at the low stop"},
    {"secondary_piston_area_m2", &VariatorParameters::secondary_piston_area_m2, false, 0.009, 0.013,
     "m2",
     "pi/4 (D^2 - d^2) of the secondary cylinder's seals: repair manual, or measured on the part"},
    {"secondary_spring_force_N", &VariatorParameters::secondary_spring_force_N, true, 300.0, 2000.0,
     "N",
     "spring of the secondary pulley at the end stop: weighed on a press, or its maker's data"},
    {"secondary_centrifugal_N_s2", &VariatorParameters::secondary_centrifugal_N_s2, false, 0.0,
     0.012, "N s2",
     "oil turning in the secondary cylinder, pi/4 rho (Ro^4 - Ri^4) less its feed's share; 0 only "
     "with a balance chamber that cancels it"},
    {"primary_inertia_kg_m2", &VariatorParameters::primary_inertia_kg_m2, false, 0.12, 0.25,
     "kg m2",
     "engine, converter and primary pulley with the lock-up closed: beltgrip calibrate, from steps "
     "of the torque"},
}};

// A bus torque is specified to 5 Nm up to 50 Nm and to 10 % above, which is taken as two
// deviations; a pressure sensor to 30 to 90 kPa and 1 to 1.5 %; a toothed wheel errs by its
// coding alone.
constexpr std::array<TypicalAccuracy, 4> kTypical{{
    {{0.05, 5e-4}, "step of the signal in the DBC; the wheel's teeth are exact"},
    {{30e3, 0.0125}, "reading at key-on with the engine off (beltgrip calibrate), sensor's data"},
    {{2.5, 0.05}, "engine maker's specification; losses before the belt and auxiliaries count"},
    {{0.5, 0.01}, "torque sensor's data sheet"},
}};

// x with this share of a standard normal distribution below it; absolute error below 5e-4, which
// is nothing beside what is drawn with it (Abramowitz and Stegun 26.2.23).
double normal_quantile(double share) {
  const double tail = std::min(share, 1.0 - share);
  const double t = std::sqrt(-2.0 * std::log(tail));
  const double x = t - (2.515517 + t * (0.802853 + t * 0.010328)) /
                           (1.0 + t * (1.432788 + t * (0.189269 + t * 0.001308)));
  return share < 0.5 ? -x : x;
}

constexpr std::size_t kNormals = 3;
constexpr std::size_t kDimensions = kConstantCount + kNormals;

// The additive recurrence whose steps are powers of the root of x^(d+1) = x + 1: as even in d
// dimensions as the golden ratio is in one.
std::array<double, kDimensions> steps() {
  double root = 1.0;
  for (int i = 0; i < 100; ++i) {
    root = std::pow(1.0 + root, 1.0 / (static_cast<double>(kDimensions) + 1.0));
  }
  std::array<double, kDimensions> step{};
  double power = 1.0;
  for (double& each : step) each = power /= root;
  return step;
}

constexpr double kLeastForce_N = 1.0;

}  // namespace

double Assumption::quantile(double share) const noexcept {
  if (logarithmic) return least * std::pow(most / least, share);
  return least + share * (most - least);
}

const std::array<Assumption, kConstantCount>& assumptions() noexcept { return kAssumptions; }

const TypicalAccuracy& typical_accuracy(Sensor sensor) noexcept {
  return kTypical[static_cast<std::size_t>(sensor)];
}

AssumedConstants::AssumedConstants(const VariatorParameters& variator,
                                   const SensorAccuracies& accuracies, const ConstantSet& assumed)
    : variator_(variator), accuracies_(accuracies), draws_(kDraws), values_(kDraws) {
  const auto step = steps();
  std::array<double, kDimensions> at{};
  at.fill(0.5);
  for (Draw& draw : draws_) {
    for (std::size_t i = 0; i < kDimensions; ++i) at[i] = std::fmod(at[i] + step[i], 1.0);
    draw.variator = variator;
    for (std::size_t i = 0; i < kConstantCount; ++i) {
      if (assumed.test(i)) draw.variator.*kAssumptions[i].value = kAssumptions[i].quantile(at[i]);
    }
    draw.noise = normal_quantile(at[kConstantCount]);
    draw.pressure_bias_Pa =
        accuracies.secondary_pressure.bias * normal_quantile(at[kConstantCount + 1]);
    draw.pressure_gain =
        accuracies.secondary_pressure.gain * normal_quantile(at[kConstantCount + 2]);
  }
}

void AssumedConstants::begin(const PeakReading& reading) noexcept {
  const double square = reading.omega_s_rad_s * reading.omega_s_rad_s;
  reading_ = reading;
  pressure_Pa_ = (reading.clamp_force_N - variator_.secondary_spring_force_N -
                  variator_.secondary_centrifugal_N_s2 * square) /
                 variator_.secondary_piston_area_m2;
  const double torque_error =
      std::hypot(accuracies_.torque.bias / reading.torque_Nm, accuracies_.torque.gain);
  deviation_ = std::hypot(reading.relative_noise, torque_error);
  next_ = 0;
  stage_ = Stage::kDraws;
}

// What mu was if this draw is the truth.
double AssumedConstants::value_of(const Draw& draw) const noexcept {
  const auto radius = [this](const VariatorParameters& variator) {
    return reading_.end_stop == EndStop::kOverdrive ? variator.primary_radius_overdrive_m
                                                    : variator.primary_radius_low_m;
  };
  const double force_N =
      draw.variator.secondary_piston_area_m2 *
          (pressure_Pa_ * (1.0 + draw.pressure_gain) + draw.pressure_bias_Pa) +
      draw.variator.secondary_spring_force_N +
      draw.variator.secondary_centrifugal_N_s2 * reading_.omega_s_rad_s * reading_.omega_s_rad_s;
  const double torque_Nm =
      reading_.torque_Nm - (draw.variator.primary_inertia_kg_m2 - variator_.primary_inertia_kg_m2) *
                               reading_.acceleration_rad_s2;
  return reading_.mu * reading_.clamp_force_N / std::max(force_N, kLeastForce_N) *
         std::max(torque_Nm / reading_.torque_Nm, 0.0) * radius(variator_) / radius(draw.variator) *
         std::exp(deviation_ * draw.noise);
}

double AssumedConstants::quantile(double share, std::size_t from, std::size_t to) noexcept {
  const auto at = [this](std::size_t index) {
    return values_.begin() + static_cast<std::ptrdiff_t>(index);
  };
  const auto wanted =
      at(static_cast<std::size_t>(std::lround(share * static_cast<double>(kDraws))));
  std::nth_element(at(from), wanted, at(to));
  return *wanted;
}

bool AssumedConstants::step() noexcept {
  constexpr std::size_t kMiddle = kDraws / 2;
  switch (stage_) {
    case Stage::kDraws:
      for (std::size_t i = 0; i < kDrawsPerStep; ++i, ++next_) {
        values_[next_] = value_of(draws_[next_]);
      }
      if (next_ == kDraws) stage_ = Stage::kMedian;
      return false;
    case Stage::kMedian:
      spread_.median = quantile(0.5, 0, kDraws);
      stage_ = Stage::kLow;
      return false;
    case Stage::kLow:
      spread_.low = quantile(kTail95, 0, kMiddle);
      stage_ = Stage::kHigh;
      return false;
    case Stage::kHigh:
      spread_.high = quantile(kUpper95, kMiddle, kDraws);
      stage_ = Stage::kDone;
      return true;
    case Stage::kDone:
      break;
  }
  return true;
}

}  // namespace beltgrip::estimator
