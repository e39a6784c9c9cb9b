// The ratio at the end stops, extrapolated to zero clamping force, and the delay between the
// speeds, from the same cells.
#include <algorithm>
#include <array>
#include <cmath>

#include "can_dbc/text/format.h"
#include "estimator/physics/clamp_force.h"
#include "estimator/physics/slip.h"
#include "estimator/statistics/order.h"
#include "tools/calibrate/calibrate.h"
#include "tools/calibrate/cluster_fit.h"
#include "tools/calibrate/series.h"

namespace beltgrip::calibrate {

namespace {

using daemon::Role;
using estimator::EndStop;

constexpr double kCell_s = 0.5;
constexpr double kGrid_s = 0.02;
constexpr double kReach = 0.06;          // ln: how far the configured ratio may be off
constexpr double kSearch = 0.25;         // ln: and where the stop of another variator is looked for
constexpr std::size_t kRestsLeast = 20;  // chosen: ten seconds at a ratio, to name it
constexpr double kDense = 0.03;          // ln: cells of one stop lie within this
constexpr double kStill = 1.5e-3;        // ln: between the halves of a cell
constexpr double kTractionMax = 0.06;    // mu*: below any peak; less leaves LOW too few cells
constexpr double kSpeedMin_rad_s = 30.0;
constexpr double kVisitGap_s = 3.0;
constexpr double kScatterMax = 2.5e-3;  // ln: a stop holds the ratio
constexpr double kWhite = 1.5;          // scatter over the noise between neighbours; 1: only noise
constexpr double kModelStd = 2e-4;      // ln: what the straight lines in F and mu* leave out
constexpr double kDelayFloor_s = 1e-3;  // and for the delay
constexpr double kStdMax = 0.003;       // 0.3 % of slip: more is not worth writing
constexpr int kVisitsMin = 4;
constexpr double kDelayStdMax_s = 0.005;
constexpr double kNewton_kN = 1e-3;
constexpr double kNextCell_s = 1.5 * kCell_s;  // chosen: no cell is left out between the two
// Chosen, of the usual scatter, and ln: normal noise leaves one cell in 16,000 beyond four sigmas.
constexpr double kFarSigmas = 4.0, kFarLeast = 2e-4;
constexpr double kAnywhere = 0.1;  // chosen, ln, one sigma: of what nothing is known before
// Derived: the ratio at no force lies no further from the forces that were seen than they reach.
// Measured (ten recordings of nothing but experiments, 1.1 to 1.5 times): errors up to 1.6 %,
// because deformation and creep cannot be told apart there; drives have 2.2 times and more.
constexpr double kForcesApart = 2.0;

struct Cell {
  double t_s = 0.0;
  double ln_ratio = 0.0;
  double force_kN = 0.0;
  double traction = 0.0;  // mu*, signed
  double rate_1_s = 0.0;  // d ln(omega_p)/dt
  int log = 0;
};

class Cells {
 public:
  Cells(const daemon::Config& config, EndStop stop, double pressure_zero_Pa)
      : config_(config),
        pressure_zero_Pa_(pressure_zero_Pa),
        point_(operating_point(config.variator, stop, estimator::Direction::kDrive)) {}

  void add(const diagnose::SignalTable& log, int number) {
    const Series primary(log[Role::kPrimarySpeed]), secondary(log[Role::kSecondarySpeed]),
        pressure(log[Role::kSecondaryPressure]),
        torque(
            log[config_.estimator.torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque]);
    if (primary.empty() || secondary.empty() || pressure.empty() || torque.empty()) return;
    const double end = std::min(primary.end_s(), secondary.end_s());
    for (double t = std::max(primary.begin_s(), secondary.begin_s()); t + kCell_s < end;
         t += kCell_s) {
      add_cell(primary, secondary, pressure, torque, t, number);
    }
  }
  std::vector<Cell> cells;  // within kSearch of the configured stop

 private:
  void add_cell(const Series& primary, const Series& secondary, const Series& pressure,
                const Series& torque, double t, int number) {
    std::array<double, 2> half{};
    double mean_p = 0.0, mean_s = 0.0, xx = 0.0, xp = 0.0;
    constexpr int kPoints = static_cast<int>(kCell_s / kGrid_s);
    for (int i = 0; i < kPoints; ++i) {
      const double x = (i + 0.5) * kGrid_s;
      const auto p = primary.at(t + x);
      const auto s = secondary.at(t + x);
      if (!p || !s || *p < kSpeedMin_rad_s || *s < 1.0) return;
      half[i < kPoints / 2 ? 0 : 1] += std::log(*s / *p);
      mean_p += *p / kPoints;
      mean_s += *s / kPoints;
      const double from_middle = x - 0.5 * kCell_s;
      xx += from_middle * from_middle;
      xp += from_middle * *p;
    }
    Cell cell;
    constexpr int kFirst = kPoints / 2;
    half[0] /= kFirst;
    half[1] /= kPoints - kFirst;
    cell.ln_ratio = std::log(mean_s / mean_p);
    if (std::abs(half[1] - half[0]) > kStill ||
        std::abs(cell.ln_ratio - std::log(point_.ratio_g0)) > kSearch) {
      return;
    }
    const auto p_Pa = pressure.mean(t, t + kCell_s);
    const auto torque_Nm = torque.mean(t, t + kCell_s);
    if (!p_Pa || !torque_Nm) return;
    const double force_N =
        secondary_clamp_force_N(config_.variator, *p_Pa - pressure_zero_Pa_, mean_s);
    if (force_N < 1.0) return;
    cell.traction = traction_coefficient(config_.variator, point_, *torque_Nm, force_N);
    if (std::abs(cell.traction) > kTractionMax) return;
    cell.t_s = t;
    cell.log = number;
    cell.force_kN = force_N * kNewton_kN;
    cell.rate_1_s = xp / xx / mean_p;
    cells.push_back(cell);
  }
  const daemon::Config& config_;
  double pressure_zero_Pa_;
  estimator::OperatingPoint point_;
};

// What is known before: deformation of 0.5 to 2 % at 5 kN, less under large forces; 0.03 to 0.1 of
// mu* per percent of micro-slip.
constexpr double kDeformation_1_kN = 1.5e-3, kDeformationStd_1_kN = 1.5e-3;
constexpr double kCreep = 0.2, kCreepStd = 0.15;
// Creep grows faster toward the peak: of slip = creep mu_max atanh(mu* / mu_max) the next term is
// creep / (3 mu_max^2) mu*^3, 2 to 20 for belts with mu_max of 0.07 to 0.13.
constexpr double kCreepGrows = 5.0, kCreepGrowsStd = 5.0;

// The stretch of kDense with the most cells in it, deformation and creep taken off as expected: the
// others are on their way, or hold a ratio beside the stop.
std::vector<Cell> densest(std::vector<Cell> cells) {
  const auto at_rest = [](const Cell& each) {
    return each.ln_ratio + kDeformation_1_kN * each.force_kN + kCreep * each.traction;
  };
  std::vector<double> sorted;
  sorted.reserve(cells.size());
  for (const Cell& each : cells) sorted.push_back(at_rest(each));
  std::sort(sorted.begin(), sorted.end());
  std::size_t best = 0, best_count = 0;
  for (std::size_t i = 0, j = 0; i < sorted.size(); ++i) {
    while (j < sorted.size() && sorted[j] <= sorted[i] + kDense) ++j;
    if (j - i > best_count) {
      best_count = j - i;
      best = i;
    }
  }
  std::erase_if(cells, [&](const Cell& each) {
    return at_rest(each) < sorted[best] || at_rest(each) > sorted[best] + kDense;
  });
  return cells;
}

enum Coefficient { kLevel, kForce, kTraction, kGrowth, kRate, kCoefficients };

Observations observations(const std::vector<Cell>& cells, double ln_configured) {
  Observations data;
  int visit = -1;
  const Cell* before = nullptr;
  for (const Cell& each : cells) {
    if (before == nullptr || each.log != before->log || each.t_s - before->t_s > kVisitGap_s) {
      ++visit;
    }
    Eigen::VectorXd x(static_cast<Eigen::Index>(kCoefficients));
    x << 1.0, -each.force_kN, -each.traction, -std::pow(each.traction, 3.0), -each.rate_1_s;
    data.add(each.ln_ratio - ln_configured, x, visit);
    before = &each;
  }
  return data;
}

// Of the residuals, from each cell to the next of the same visit: a ratio at its stop that is read
// coarsely scatters by as much; one that wanders scatters more.
double neighbour_noise(const std::vector<Cell>& cells, const std::vector<double>& residual) {
  double squares = 0.0;
  int count = 0;
  for (std::size_t i = 1; i < cells.size(); ++i) {
    const bool next =
        cells[i].log == cells[i - 1].log && cells[i].t_s - cells[i - 1].t_s < kNextCell_s;
    if (!next) continue;
    squares += 0.5 * std::pow(residual[i] - residual[i - 1], 2.0);
    ++count;
  }
  return count > 0 ? std::sqrt(squares / count) : 0.0;
}

// Where the ratio rests most, if that is not where the stop is configured: for a person to judge,
// as a controller rests at ratios of its own, too.
std::string other_rest(const std::vector<Cell>& all, double ln_configured, const std::string& key) {
  const std::vector<Cell> there = densest(all);
  if (there.size() < kRestsLeast) return {};
  std::vector<double> ratios;
  ratios.reserve(there.size());
  for (const Cell& each : there) ratios.push_back(each.ln_ratio);
  const double usual = estimator::median(ratios);
  if (std::abs(usual - ln_configured) < kReach) return {};
  return format("; it rests at %.3f for %.0f s: if that is the stop, enter ", std::exp(usual),
                kCell_s * static_cast<double>(there.size())) +
         key + format(" = %.3f and calibrate again", std::exp(usual));
}

struct StopFindings {
  Finding ratio, delay;
};

struct StopFit {
  std::vector<Cell> cells;
  ClusterFit fitted;
  double least_kN = 0.0, most_kN = 0.0;  // clamping forces

  std::string basis() const {
    return format("%zu half seconds in %d visits, %.1f to %.1f kN, scatter %.2f %%", cells.size(),
                  fitted.clusters, least_kN, most_kN, 100.0 * fitted.residual_std);
  }
};

// A cell on its way to the stop or from it lies far off all others.
std::vector<Cell> without_far(const std::vector<Cell>& cells, const std::vector<double>& residual) {
  std::vector<double> sizes;
  sizes.reserve(residual.size());
  for (const double each : residual) sizes.push_back(std::abs(each));
  const double limit =
      std::max(kFarSigmas * estimator::kSigmaPerMedian * estimator::median(sizes), kFarLeast);
  std::vector<Cell> kept;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (std::abs(residual[i]) <= limit) kept.push_back(cells[i]);
  }
  return kept;
}

StopFit fit_stop(std::vector<Cell> cells, double ln_configured) {
  Eigen::VectorXd mean(static_cast<Eigen::Index>(kCoefficients));
  Eigen::VectorXd spread(static_cast<Eigen::Index>(kCoefficients));
  mean << 0.0, kDeformation_1_kN, kCreep, kCreepGrows, 0.0;
  spread << kAnywhere, kDeformationStd_1_kN, kCreepStd, kCreepGrowsStd, kAnywhere;
  StopFit out{.cells = std::move(cells), .fitted = {}};
  constexpr int kTrims = 4;
  for (int trim = 0; trim < kTrims; ++trim) {
    out.fitted = fit(observations(out.cells, ln_configured), mean, spread);
    if (!out.fitted.solved || trim + 1 == kTrims) break;
    out.cells = without_far(out.cells, out.fitted.residual);
  }
  if (out.cells.empty()) return out;
  const auto [least, most] =
      std::minmax_element(out.cells.begin(), out.cells.end(),
                          [](const Cell& a, const Cell& b) { return a.force_kN < b.force_kN; });
  out.least_kN = least->force_kN;
  out.most_kN = most->force_kN;
  return out;
}

// Why these cells are no stop; empty: they are.
std::string refusal(const StopFit& stop, std::size_t candidates) {
  const ClusterFit& fitted = stop.fitted;
  if (!fitted.solved || fitted.clusters < kVisitsMin) {
    return format("%d visits to the stop, needs %d", fitted.clusters, kVisitsMin);
  }
  // Cells that are spread evenly come from a ratio that is controlled.
  if (2 * stop.cells.size() < candidates) {
    return format(
        "the ratio does not come to rest at one value: %zu of %zu half seconds lie "
        "together",
        stop.cells.size(), candidates);
  }
  const double noise = neighbour_noise(stop.cells, fitted.residual);
  if (fitted.residual_std > kScatterMax && fitted.residual_std > kWhite * noise) {
    return format("the ratio wanders by %.2f %%, of which noise is %.2f %%: no stop holds it",
                  100.0 * fitted.residual_std, 100.0 * noise);
  }
  return {};
}

// force_std_kN: the zero of the pressure shifts every force, and the ratio at none of it.
void find_ratio(const StopFit& stop, double ln_configured, double force_std_kN, Finding& ratio) {
  const ClusterFit& fitted = stop.fitted;
  const double level_std =
      std::hypot(fitted.std[kLevel], fitted.value[kForce] * force_std_kN, kModelStd);
  if (stop.most_kN < kForcesApart * stop.least_kN) {
    ratio.text = format(
        "under clamping forces of %.1f to %.1f kN only (%zu half seconds in %d "
        "visits), the largest is to be %.0f times the least: drive at the stop "
        "with little and with much torque",
        stop.least_kN, stop.most_kN, stop.cells.size(), fitted.clusters, kForcesApart);
    return;
  }
  if (level_std > kStdMax) {
    ratio.text =
        format("known to %.2f %% only, %.2f %% would do (", 100.0 * level_std, 100.0 * kStdMax) +
        stop.basis() + "); drive at the stop under more different clamping forces";
    return;
  }
  const double value = std::exp(ln_configured + fitted.value[kLevel]);
  ratio.value = value;
  ratio.std = value * level_std;
  ratio.text = stop.basis() + format(", falls by %.2f %% per kN", 100.0 * fitted.value[kForce]);
}

void find_delay(const StopFit& stop, bool low, Finding& delay) {
  delay.std = std::hypot(stop.fitted.std[kRate], kDelayFloor_s);
  if (delay.std > kDelayStdMax_s) {
    delay.text = format(
        "known to %.1f ms only, %.1f ms would do; accelerate and brake at the "
        "stop",
        1e3 * delay.std, 1e3 * kDelayStdMax_s);
    return;
  }
  delay.value = stop.fitted.value[kRate];
  delay.text = std::string("after primary_speed; at the ") + (low ? "low" : "overdrive") +
               " stop, " + stop.basis();
}

StopFindings one_stop(std::span<const diagnose::SignalTable> logs, const daemon::Config& config,
                      EndStop stop, PressureError pressure) {
  const bool low = stop == EndStop::kLow;
  StopFindings found;
  found.ratio.key = low ? "variator.ratio_low" : "variator.ratio_overdrive";
  found.ratio.configured = low ? config.variator.ratio_low : config.variator.ratio_overdrive;
  found.delay.key = "delay.secondary_speed";
  found.delay.unit = "s";
  Cells all(config, stop, pressure.zero);
  for (std::size_t i = 0; i < logs.size(); ++i) all.add(logs[i], static_cast<int>(i));
  const double ln_configured = std::log(found.ratio.configured);
  std::vector<Cell> near = all.cells;
  std::erase_if(near,
                [&](const Cell& each) { return std::abs(each.ln_ratio - ln_configured) > kReach; });
  const std::size_t candidates = near.size();
  const auto refuse = [&](const std::string& why) {
    found.delay.text = why;
    found.ratio.text = why + other_rest(all.cells, ln_configured, found.ratio.key);
    return found;
  };
  if (candidates == 0) {
    return refuse(
        format("no half second within %.0f %% of the configured %.4g in which the ratio "
               "stands still under little traction",
               100.0 * kReach, found.ratio.configured));
  }
  const StopFit fitted = fit_stop(densest(near), ln_configured);
  if (const std::string why = refusal(fitted, candidates); !why.empty()) return refuse(why);
  const double force_std_kN = config.variator.secondary_piston_area_m2 * pressure.std * kNewton_kN;
  find_ratio(fitted, ln_configured, force_std_kN, found.ratio);
  find_delay(fitted, low, found.delay);
  return found;
}

}  // namespace

std::vector<Finding> end_stops(std::span<const diagnose::SignalTable> logs,
                               const daemon::Config& config, PressureError pressure) {
  StopFindings low = one_stop(logs, config, EndStop::kLow, pressure);
  StopFindings overdrive = one_stop(logs, config, EndStop::kOverdrive, pressure);
  // One delay: that of the stop which says more.
  const bool from_low =
      low.delay.value && (!overdrive.delay.value || low.delay.std < overdrive.delay.std);
  return {low.ratio, overdrive.ratio, from_low ? low.delay : overdrive.delay};
}

}  // namespace beltgrip::calibrate
