#include "tools/diagnose/infer/cells.h"

#include <algorithm>
#include <map>
#include <utility>

#include "tools/diagnose/infer/cell_columns.h"

namespace beltgrip::diagnose {
namespace {

// Where all experiments are the same ramp, time is the clamp force by another name: of the spread
// of the pressure nothing is left between samples of one time.
bool is_time_a_ramp(const Campaign& campaign) {
  constexpr double kLeft = 0.05;  // chosen, of the variance
  constexpr double kBin_s = 1.0;
  struct Bin {
    double count = 0.0, sum = 0.0, squares = 0.0;
    void add(double value) {
      count += 1.0;
      sum += value;
      squares += value * value;
    }
    double variation() const { return squares - sum * sum / std::max(count, 1.0); }
  };
  std::map<std::pair<int, int>, Bin> by_time;  // end stop, time
  std::map<int, Bin> all;
  for (const ExperimentData& run : campaign.runs) {
    for (int k = 0; k < run.size(); ++k) {
      const auto i = static_cast<std::size_t>(k);
      if (!run.valid[i]) continue;
      const double bar = 1e-5 * run.pressure.value[k];
      by_time[{run.stop[i], static_cast<int>(run.t_s[k] / kBin_s)}].add(bar);
      all[run.stop[i]].add(bar);
    }
  }
  double left = 0.0, whole = 0.0;
  for (const auto& [key, bin] : by_time) left += bin.variation();
  for (const auto& [key, bin] : all) whole += bin.variation();
  return left < kLeft * whole;
}

// The curve's own abscissa is torque over capacity: in a ramp the clamp force is it by another
// name.
bool is_sensible(const IndexVariable& variable, const InjectionRow& row, const Campaign& campaign) {
  const std::string_view name = variable.name;
  if (name == "secondary_pressure") return false;
  // What follows the rate is a delay, a lag or a play: dynamics, which no function of it describes.
  if (name == "pressure_rate") return false;
  if (name == "time" && is_time_a_ramp(campaign)) return false;
  if (name == "torque") {
    return campaign.torque_varies && row.injection == Injection::kFriction;
  }
  // Without the torque behind the belt these two are friction by another name.
  const bool like_friction =
      row.injection == Injection::kTorqueGain || row.injection == Injection::kClampForce;
  return campaign.has_balance || !like_friction;
}

}  // namespace

std::vector<Cell> score_cells(const Engine& engine) {
  std::vector<Cell> out;
  if (engine.whitening().random.empty()) return out;  // stopped before the noise was known
  CellBase base = cell_base(engine);
  for (const IndexVariable& variable : index_variables()) {
    const std::optional<Abscissa> abscissa = abscissa_of(engine.campaign(), variable);
    if (!abscissa) continue;
    for (const InjectionRow& row : kInjections) {
      if (!is_sensible(variable, row, engine.campaign())) continue;
      const CellColumns columns = cell_columns(engine, base, *abscissa, row);
      Cell cell;
      cell.injection = &row;
      cell.abscissa = *abscissa;
      cell.scores = scores_of(columns, base, KnotVector::Zero());
      keep_own(columns, base, cell.scores);
      judge_cell(cell);
      out.push_back(std::move(cell));
    }
  }
  std::sort(out.begin(), out.end(),
            [](const Cell& a, const Cell& b) { return a.gain() > b.gain(); });
  return out;
}

}  // namespace beltgrip::diagnose
