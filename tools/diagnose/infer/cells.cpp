#include "tools/diagnose/infer/cells.h"

#include <algorithm>

#include "tools/diagnose/infer/cell_columns.h"
#include "tools/diagnose/infer/conditions.h"

namespace beltgrip::diagnose {
namespace {

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
