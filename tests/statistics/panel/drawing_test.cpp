// The drawing against what the issue of a wider world asks: each curve has its top and its fall
// where it says, found here by search; peaks lie evenly, falls log-evenly; the truth of a trace is
// the top of eq. 5 as computed here from samples without noise.
#include "drawing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <vector>

#include "panel_bands.h"
#include "random.h"
#include "virtual_variator.h"

namespace beltgrip::panel {
namespace {

constexpr std::uint64_t kSeeds = 4000;

std::vector<Scenario> drawn() {
  std::vector<Scenario> out;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) out.push_back(draw_scenario(seed));
  return out;
}

// Where the curve is largest, by search.
double top_slip_percent(const FrictionCurve& curve, double to) {
  double best = 0.0;
  for (double slip_percent = 0.0; slip_percent <= to; slip_percent += 2e-3) {
    if (curve.value(slip_percent) > curve.value(best)) best = slip_percent;
  }
  return best;
}

TEST(Drawing, EveryCurveHasItsTopWhereItSays) {
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    const FrictionCurve curve = draw_scenario(seed).curve;
    if (!curve.has_peak()) continue;
    const double slip_percent = top_slip_percent(curve, 20.0);
    const double end =
        curve.slip_peak_percent() + (curve.family() == Family::kPlateau ? curve.shape() : 0.0);
    EXPECT_GE(slip_percent, curve.slip_peak_percent() - 0.01)
        << seed << family_name(curve.family());
    EXPECT_LE(slip_percent, end + 0.01) << seed << family_name(curve.family());
    EXPECT_NEAR(curve.value(slip_percent), curve.mu_max(), 1e-4 * curve.mu_max())
        << seed << family_name(curve.family());
    EXPECT_DOUBLE_EQ(curve.value(-slip_percent), -curve.value(slip_percent));
  }
}

TEST(Drawing, EveryCurveRisesToItsTopAndFallsBehindIt) {
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    const FrictionCurve curve = draw_scenario(seed).curve;
    const double top = curve.has_peak() ? curve.slip_peak_percent() : 30.0;
    for (double slip_percent = 0.0; slip_percent + 0.01 < top; slip_percent += 0.01) {
      ASSERT_LE(curve.value(slip_percent), curve.value(slip_percent + 0.01) + 1e-9)
          << seed << family_name(curve.family()) << slip_percent;
    }
    for (double slip_percent = top; curve.has_peak() && slip_percent < 30.0; slip_percent += 0.01) {
      ASSERT_GE(curve.value(slip_percent) + 1e-9, curve.value(slip_percent + 0.01))
          << seed << family_name(curve.family()) << slip_percent;
    }
  }
}

TEST(Drawing, TheFallIsTheMeanOverThreePointsBehindTheTop) {
  for (std::uint64_t seed = 1; seed <= 600; ++seed) {
    const FrictionCurve curve = draw_scenario(seed).curve;
    if (!curve.has_peak()) continue;
    const bool plateau = curve.family() == Family::kPlateau;
    const double end = curve.slip_peak_percent() + (plateau ? curve.shape() : 0.0);
    const double fall = (curve.mu_max() - curve.value(end + 3.0)) / 3.0;
    // A third of the plateau's bend is rounded; the rest as the family can.
    const double near = plateau ? 0.15 : 0.11;
    EXPECT_NEAR(fall, curve.fall_per_percent(), near * curve.fall_per_percent())
        << seed << family_name(curve.family());
  }
}

TEST(Drawing, WhereFrictionRisesOnItsTopIsAtTenPercent) {
  int seen = 0;
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    const FrictionCurve curve = draw_scenario(seed).curve;
    if (curve.has_peak()) continue;
    ++seen;
    EXPECT_NEAR(curve.value(10.0), curve.mu_max(), 1e-12);
    EXPECT_GT(curve.value(30.0), curve.value(10.0));
  }
  EXPECT_GT(seen, 30);
}

TEST(Drawing, PeaksLieEvenlyFallsLogEvenly) {
  std::array<int, 4> peaks{}, falls{};
  int curves = 0;
  std::array<int, kFamilies> families{};
  for (const Scenario& s : drawn()) {
    ++families[static_cast<std::size_t>(s.curve.family())];
    if (!s.curve.has_peak()) continue;
    ++curves;
    const double place = (s.curve.slip_peak_percent() - 0.8) / 7.2;
    const double fall = std::log(s.curve.fall_per_percent() / 2e-4) / std::log(60.0);
    ASSERT_TRUE(place >= 0.0 && place < 1.0 && fall >= 0.0 && fall < 1.0);
    ++peaks[static_cast<std::size_t>(4.0 * place)];
    ++falls[static_cast<std::size_t>(4.0 * fall)];
  }
  // Four standard deviations of a quarter's count.
  const double apart = 4.0 * std::sqrt(curves * 0.25 * 0.75);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(peaks[i], curves / 4.0, apart) << i;
    EXPECT_NEAR(falls[i], curves / 4.0, apart) << i;
  }
  for (int i = 0; i < kFamilies; ++i) {
    EXPECT_GT(families[static_cast<std::size_t>(i)], 100) << family_name(static_cast<Family>(i));
  }
}

TEST(Drawing, CarsHaveSlowSignals) {
  int slow = 0, cars = 0;
  std::set<double> engine_hz;
  for (const Scenario& s : drawn()) {
    if (!is_car(s.plant) || s.noise == NoiseClass::kLab) continue;
    ++cars;
    slow += s.pressure.frame_rate_hz <= 25.0 ? 1 : 0;
    if (s.plant != PlantKind::kCarEngine) continue;
    engine_hz.insert(s.torque.frame_rate_hz);
    EXPECT_GE(s.torque_lag_s, 0.01);
  }
  EXPECT_EQ(engine_hz, (std::set<double>{25.0, 50.0, 100.0}));
  EXPECT_GT(slow, cars / 4);
}

TEST(Drawing, TheTruthOfATraceIsTheTopOfEquationFive) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    Scenario s = draw_scenario(seed);
    if (!s.curve.has_peak() || s.plant == PlantKind::kCarEngine) continue;
    const ChannelNoise exact = {0.0, 0.0, 1000.0, 0.0};
    s.omega_p = s.omega_s = s.pressure = s.torque = exact;
    s.torque_lag_s = 0.0;
    s.mu_floor = 1e9;
    const Trace trace = simulate(s);
    if (!trace.peak_reached) continue;
    const auto peak = static_cast<std::size_t>(trace.t_peak_s * s.sample_rate_hz);
    const estimator::VariatorSample& at = trace.samples[peak];
    const double force =
        s.variator.secondary_piston_area_m2 * at.secondary_pressure_Pa +
        s.variator.secondary_spring_force_N +
        s.variator.secondary_centrifugal_N_s2 * at.omega_s_rad_s * at.omega_s_rad_s;
    const double radius =
        s.low ? s.variator.primary_radius_low_m : s.variator.primary_radius_overdrive_m;
    const double mu =
        std::abs(at.torque_Nm) * std::cos(s.variator.half_wedge_angle_rad) / (2.0 * radius * force);
    EXPECT_NEAR(mu, trace.mu_max, 2e-3 * trace.mu_max) << describe(s);
    // The loss is a share of the load; the belt may carry less than that while the machine slows.
    const double loss_Nm = s.primary_loss_share * s.torque_Nm * at.omega_p_rad_s / s.omega_p_rad_s;
    EXPECT_NEAR(trace.mu_max / s.curve.mu_max() - 1.0, loss_Nm / trace.torque_belt_Nm[peak], 1e-3)
        << describe(s);
  }
}

TEST(Drawing, TheSameSeedGivesTheSameTrace) {
  const Trace once = simulate(draw_scenario(7)), again = simulate(draw_scenario(7)),
              other = simulate(draw_scenario(8));
  ASSERT_EQ(once.samples.size(), again.samples.size());
  for (std::size_t i = 0; i < once.samples.size(); ++i) {
    ASSERT_EQ(once.samples[i].torque_Nm, again.samples[i].torque_Nm);
  }
  EXPECT_NE(once.samples[10].torque_Nm, other.samples[10].torque_Nm);
}

TEST(Bands, OnACaseByHand) {
  EXPECT_EQ(band_of(1.49), 0);
  EXPECT_EQ(band_of(1.5), 1);
  EXPECT_EQ(band_of(4.49), 3);
  EXPECT_EQ(band_of(8.0), 4);

  const auto trace = [](double slip_peak_percent, PlantKind plant, double past, double mu,
                        double half) {
    Judged t;
    t.has_peak = true;
    t.mu_max = 0.1;
    t.scenario.plant = plant;
    t.scenario.curve = FrictionCurve(Family::kPower, 0.1, slip_peak_percent, 1e-3, 2.0);
    t.robust.slip_past_percent = past;
    if (mu <= 0.0) return t;
    t.robust.peak.kind = estimator::PeakKind::kValue;
    t.robust.peak.mu_max = mu;
    t.robust.relative_error = mu / 0.1 - 1.0;
    t.robust.peak.noise_low = mu - half;
    t.robust.peak.noise_high = mu + half;
    return t;
  };
  std::vector<Judged> traces = {trace(2.0, PlantKind::kRig, 0.3, 0.101, 0.002),
                                trace(2.0, PlantKind::kRig, 0.5, 0.104, 0.002),
                                trace(2.2, PlantKind::kCarEngine, 0.9, 0.1, 0.009),
                                trace(2.2, PlantKind::kRig, 0.1, 0.0, 0.0),
                                trace(6.0, PlantKind::kCarSensor, 1.9, 0.0, 0.0)};
  traces.back().robust.peak.contradictory = true;
  const BandFigures band = band_figures(traces, NoiseClass::kLab, 1);
  EXPECT_EQ(band.traces, 4);
  EXPECT_DOUBLE_EQ(band.value, 75.0);
  EXPECT_DOUBLE_EQ(band.narrow, 50.0);
  EXPECT_NEAR(band.covered, 200.0 / 3.0, 1e-9);
  EXPECT_NEAR(band.p95, 4.0, 1e-9);
  EXPECT_DOUBLE_EQ(band.rig_past_p99, 0.5);
  EXPECT_DOUBLE_EQ(band.car_past_p90, 0.9);
  EXPECT_DOUBLE_EQ(band.refused, 0.0);
  EXPECT_DOUBLE_EQ(band_figures(traces, NoiseClass::kLab, {}).refused, 20.0);

  for (Judged& each : traces) {
    each.has_peak = false;
    each.scenario.curve = FrictionCurve(Family::kRising, 0.1, 2.0, 0.0, 0.2);
  }
  const RisingFigures rising = rising_figures(traces, NoiseClass::kLab);
  EXPECT_EQ(rising.traces, 5);
  EXPECT_DOUBLE_EQ(rising.value, 60.0);
  EXPECT_NEAR(rising.missed, 100.0 / 3.0, 1e-9);
}

}  // namespace
}  // namespace beltgrip::panel
