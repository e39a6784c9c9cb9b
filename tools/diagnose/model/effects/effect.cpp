#include "tools/diagnose/model/effects/effect.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "estimator/statistics/order.h"

namespace beltgrip::diagnose {
namespace {

std::vector<EffectRow> join() {
  std::vector<Equation> equations;
  for (const auto& some : {measurement_equations(), clamping_equations(), driveline_equations(),
                           friction_equations()}) {
    equations.insert(equations.end(), some.begin(), some.end());
  }
  std::vector<EffectRow> rows;
  for (const estimator::EffectRow& row : estimator::effect_rows()) {
    if (row.typical == 0.0) continue;
    const auto equation =
        std::find_if(equations.begin(), equations.end(), [&row](const Equation& each) {
          return each.id == row.id && each.parameter == row.parameter;
        });
    if (equation == equations.end()) {
      throw std::logic_error(std::string(row.id) + "." + std::string(row.parameter) +
                             " has no equation");
    }
    rows.push_back({row, *equation});
  }
  return rows;
}

bool any(const std::vector<ExperimentData>& runs, auto&& has) {
  for (const ExperimentData& run : runs) {
    if (run.valid_count > 0 && has(run)) return true;
  }
  return false;
}

bool has_stop(const ExperimentData& run, int stop) {
  for (std::size_t k = 0; k < run.valid.size(); ++k) {
    if (run.valid[k] && run.stop[k] == stop) return true;
  }
  return false;
}

// Samples that count and lie so soon behind a step of the pressure that a lag still shows in them,
// however little of the step itself counts. ramp_Pa_s: what the pressure does elsewhere.
bool steps_are_remembered(const std::vector<ExperimentData>& runs, double ramp_Pa_s) {
  constexpr double kMemory_s = 1.0;  // chosen: ten usual lags, three of the longest that are usual
  constexpr double kStep = 3.0;      // chosen, times what a ramp moves it by in that time
  constexpr int kCountMin = 20;      // chosen: two experiments and more show it
  int count = 0;
  for (const ExperimentData& run : runs) {
    const int back = static_cast<int>(std::lround(kMemory_s / run.dt_s));
    for (int k = back; k < run.size(); ++k) {
      const double moved_Pa = run.pressure.value[k] - run.pressure.value[k - back];
      count += run.valid[static_cast<std::size_t>(k)] &&
               std::abs(moved_Pa) > kStep * kMemory_s * ramp_Pa_s;
    }
  }
  return count >= kCountMin;
}

// Ramps at one and the same rate shift the force of a lag by one and the same amount: there it is
// no other thing than an offset, or another shape of the friction curve.
bool pressure_moves_variously(const std::vector<ExperimentData>& runs) {
  constexpr double kMoves = 0.2, kVarious = 0.5;  // of the usual largest rate
  constexpr int kBlock = 20;                      // samples: noise is no variety
  std::vector<double> rates;
  for (const ExperimentData& run : runs) {
    double sum = 0.0;
    int count = 0;
    for (int k = 0; k < run.size(); ++k) {
      const bool valid = run.valid[static_cast<std::size_t>(k)];
      sum = valid ? sum + run.pressure.slow_slope[k] : 0.0;
      count = valid ? count + 1 : 0;
      if (count < kBlock) continue;
      rates.push_back(sum / kBlock);
      sum = 0.0;
      count = 0;
    }
  }
  if (rates.empty()) return false;
  const auto quantile = [&](double share) {
    return estimator::at_rank(
        rates, static_cast<std::size_t>(share * static_cast<double>(rates.size() - 1)));
  };
  const double largest = std::max(std::abs(quantile(0.02)), std::abs(quantile(0.98)));
  if (steps_are_remembered(runs, largest)) return true;
  std::erase_if(rates, [&](double rate) { return !(std::abs(rate) > kMoves * largest); });
  return !rates.empty() && quantile(0.95) - quantile(0.05) > kVarious * largest;
}

}  // namespace

std::string Slot::label() const {
  std::string text = std::string(row->id) + "." + std::string(row->parameter);
  if (!role.empty()) text += "@" + std::string(role);
  if (counts_experiments()) text += "@" + std::to_string(index);
  return text;
}

double Slot::to_contract(double value, const Eigen::VectorXd& nuisance) const {
  if (row->to_contract == nullptr) return value;
  return row->to_contract(value, 100.0 * std::exp(nuisance[kLnPeakSlipOverdrive]),
                          std::exp(nuisance[kLnMuMax]));
}

double Slot::from_contract(double value, const std::map<std::string, double>& friction) const {
  if (row->from_contract == nullptr) return value;
  return row->from_contract(value, friction.at("peak_slip_overdrive_percent"),
                            friction.at("mu_max"));
}

std::span<const EffectRow> effect_rows() {
  static const std::vector<EffectRow> kRows = join();
  return kRows;
}

std::vector<Slot> make_slots(const std::vector<ExperimentData>& runs) {
  Carried data;
  data.experiments = static_cast<int>(runs.size());
  data.temperature = any(runs, [](const auto& run) { return run.temperature.present; });
  data.command = any(runs, [](const auto& run) { return run.command.present; });
  data.secondary_torque = any(runs, [](const auto& run) { return run.torque_s.present; });
  data.low = any(runs, [](const auto& run) { return has_stop(run, kLowStop); });
  data.overdrive = any(runs, [](const auto& run) { return has_stop(run, kOverdriveStop); });
  data.pressure_varies = pressure_moves_variously(runs);
  std::vector<Slot> slots;
  for (const EffectRow& row : effect_rows()) {
    const auto add = [&](int index, std::string_view role) {
      slots.push_back({&row, index, role});
    };
    if (row.apply == nullptr) continue;
    if (row.slots != nullptr) {
      row.slots(data, add);
    } else {
      add(0, {});
    }
  }
  return slots;
}

}  // namespace beltgrip::diagnose
