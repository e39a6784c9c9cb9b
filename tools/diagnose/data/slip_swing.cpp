#include "tools/diagnose/data/slip_swing.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace beltgrip::diagnose {
namespace {

// Derived: the level about a hump at the highest frequency is told from as far beyond. Measured,
// six campaigns of other make, two that swing alone (119 and 9.8 sigmas) and those next to them
// (2.9 to 3.5): a fifth less the same; a fifth more leaves fewer pieces, and one whose inertia is
// off comes to 6.1. The other numbers here a fifth less or more, one after the other: the same.
constexpr double kBeyond_Hz = 2.0;
// Chosen, sigmas of a hump in a torque or in the pressure: what swings there moves the slip too,
// and the machine answers as it should.
constexpr double kDrivesSigmas = 2.5;
constexpr std::size_t kDrivesAround = 2;  // chosen, in PooledSpectrum::kStep_Hz; 1 and 3: the same
// Derived, in power: what both shafts do leaves in their difference what they do within the time
// between the two readings: of a swing at kSwingMost_Hz a third in amplitude at 4 ms.
constexpr double kShared = 0.1;
// Chosen, one sigma of the slip: no two speeds are read better. As residuals.cpp has it of the
// fitted noise.
constexpr double kNoiseLeast_share = 2e-6;

// Where a ripple of the shaft shows at this sample rate.
double folded_Hz(double omega_rad_s, double rate_Hz) {
  const double turns_Hz = omega_rad_s / (2.0 * std::numbers::pi);
  return std::abs(turns_Hz - rate_Hz * std::round(turns_Hz / rate_Hz));
}

}  // namespace

void SlipSpectra::add(const SlipSpectra& other) {
  slip.add(other.slip);
  primary_speed.add(other.primary_speed);
  secondary_speed.add(other.secondary_speed);
  pressure.add(other.pressure);
}

SlipSpectra slip_spectra(const SignalTable& table, double rounding_share) {
  SlipSpectra out;
  const Channel& primary = table[Role::kPrimarySpeed];
  const Channel& secondary = table[Role::kSecondarySpeed];
  if (primary.empty() || primary.t_s != secondary.t_s) return out;
  const double period_s = median_period_s(primary);
  if (!(period_s > 0.0)) return out;
  const auto is_usable = [&](double omega_rad_s) {
    return omega_rad_s > 0.0 && folded_Hz(omega_rad_s, 1.0 / period_s) > kSwingMost_Hz + kBeyond_Hz;
  };
  Channel slip, of_primary, of_secondary;
  const auto end_stretch = [&] {
    out.slip.add(pooled_spectrum(slip, kSwingMost_Hz));
    out.primary_speed.add(pooled_spectrum(of_primary, kSwingMost_Hz));
    out.secondary_speed.add(pooled_spectrum(of_secondary, kSwingMost_Hz));
    slip = of_primary = of_secondary = {};
  };
  for (std::size_t i = 0; i < primary.t_s.size(); ++i) {
    if (!is_usable(primary.value[i]) || !is_usable(secondary.value[i])) {
      if (!slip.empty()) end_stretch();
      continue;
    }
    const double ln_primary = std::log(primary.value[i]);
    const double ln_secondary = std::log(secondary.value[i]);
    for (const auto& [channel, value] : {std::pair{&slip, ln_secondary - ln_primary},
                                         {&of_primary, ln_primary},
                                         {&of_secondary, ln_secondary}}) {
      channel->t_s.push_back(primary.t_s[i]);
      channel->value.push_back(value);
    }
  }
  if (!slip.empty()) end_stretch();
  // Derived, of Hann's window: white noise has 3/8 of its variance at each step of a piece, a swing
  // an eighth for each sample at its own step and a quarter of that on either side.
  const double samples = 1.0 / (PooledSpectrum::kStep_Hz * period_s);
  const double least = 0.375 * kNoiseLeast_share * kNoiseLeast_share +
                       rounding_share * rounding_share * samples / 16.0;
  for (double& power : out.slip.power) power += least * out.slip.pieces;
  out.pressure = pooled_spectrum(table[Role::kSecondaryPressure], kSwingMost_Hz);
  return out;
}

Hump slip_swing(const SlipSpectra& spectra, const PooledSpectrum& torque,
                const PooledSpectrum& secondary_torque) {
  const auto drives = [&](const PooledSpectrum& spectrum, std::size_t bin) {
    for (std::size_t j = bin - kDrivesAround; j <= bin + kDrivesAround; ++j) {
      if (hump_at(spectrum, j).excess > kDrivesSigmas) return true;
    }
    return false;
  };
  Hump out;
  for (std::size_t bin = kDrivesAround; bin < spectra.slip.power.size(); ++bin) {
    const Hump here = hump_at(spectra.slip, bin);
    if (here.excess <= out.excess) continue;
    const double shared = std::min(power_about(spectra.primary_speed, bin),
                                   power_about(spectra.secondary_speed, bin));
    if (power_about(spectra.slip, bin) < kShared * shared) continue;
    if (drives(spectra.pressure, bin) || drives(torque, bin) || drives(secondary_torque, bin)) {
      continue;
    }
    out = here;
  }
  return out;
}

}  // namespace beltgrip::diagnose
