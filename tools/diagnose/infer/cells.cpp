#include "tools/diagnose/infer/cells.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>

#include "tools/diagnose/infer/cell_columns.h"
#include "tools/diagnose/infer/conditions.h"

namespace beltgrip::diagnose {
namespace {

// The curve's own abscissa is torque over capacity: at one torque the clamp force is it by another
// name. Only what acts on the torque shows elsewhere, behind the belt.
bool is_sensible(const IndexVariable& variable, const InjectionRow& row, const Campaign& campaign) {
  const std::string_view name = variable.name;
  if (name == "secondary_pressure") {
    const bool is_torque =
        row.injection == Injection::kTorque || row.injection == Injection::kTorqueGain;
    if (is_torque) return campaign.has_balance;
    return campaign.torque_varies || row.injection == Injection::kRatio;
  }
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

// A step or a bump of the ratio over the pressure, at one torque.
bool is_told_by_form(const IndexVariable& variable, const InjectionRow& row,
                     const Campaign& campaign) {
  return std::string_view(variable.name) == "secondary_pressure" &&
         row.injection == Injection::kRatio && !campaign.torque_varies;
}

// A torque that rests on its steps is off by up to half of one, and by the same at the same
// pressure in experiments that run alike.
struct HalfStep {
  double torque_Nm = 0.0;  // before the belt; 0: none rests
  double share = 0.0;      // of the torque
};

HalfStep half_step(const Campaign& campaign) {
  HalfStep out;
  for (const ExperimentData& run : campaign.runs) {
    double torque_Nm = 0.0, ratio = 0.0, count = 0.0;
    for (int k = 0; k < run.size(); ++k) {
      if (!run.valid[static_cast<std::size_t>(k)]) continue;
      torque_Nm += std::abs(run.torque.slow[k]);
      ratio += run.omega_s.slow[k] / run.omega_p.slow[k];
      count += 1.0;
    }
    if (count == 0.0) continue;
    double sigma_Nm = run.rests_torque.empty() ? 0.0 : run.rounding_torque_Nm;
    if (!run.rests_torque_s.empty()) sigma_Nm += run.rounding_torque_s_Nm * ratio / count;
    const double half_Nm = std::numbers::sqrt3 * sigma_Nm;
    out.torque_Nm = std::max(out.torque_Nm, half_Nm);
    out.share = std::max(out.share, half_Nm * count / torque_Nm);
  }
  return out;
}

// What a torque over the pressure may be by the rounding alone. A straight line is a drag that
// grows with the clamp force, as every machine has one.
bool is_rounding(const HalfStep& half, const Cell& cell) {
  if (std::string_view(cell.abscissa.variable->name) != "secondary_pressure") return false;
  const KnotVector line = KnotVector::LinSpaced(-1.0, 1.0);
  const KnotVector level = cell.mean.array() - cell.mean.mean();
  const KnotVector bend = level - line * (line.dot(level) / line.squaredNorm());
  const double size = bend.cwiseAbs().maxCoeff() * cell.injection->unit;
  if (cell.injection->injection == Injection::kTorque) return size < half.torque_Nm;
  return cell.injection->injection == Injection::kTorqueGain && size < half.share;
}

}  // namespace

std::vector<Cell> score_cells(const Engine& engine) {
  std::vector<Cell> out;
  if (engine.whitening().random.empty()) return out;  // stopped before the noise was known
  CellBase base = cell_base(engine);
  const HalfStep half = half_step(engine.campaign());
  for (const IndexVariable& variable : index_variables()) {
    const std::optional<Abscissa> abscissa = abscissa_of(engine.campaign(), variable);
    if (!abscissa) continue;
    for (const InjectionRow& row : kInjections) {
      if (!is_sensible(variable, row, engine.campaign())) continue;
      const CellColumns columns = cell_columns(engine, base, *abscissa, row);
      Cell cell;
      cell.injection = &row;
      cell.abscissa = *abscissa;
      cell.is_told_by_form = is_told_by_form(variable, row, engine.campaign());
      cell.scores = scores_of(columns, base, KnotVector::Zero());
      keep_own(columns, base, cell.scores);
      judge_cell(cell);
      if (is_rounding(half, cell)) continue;
      out.push_back(std::move(cell));
    }
  }
  std::sort(out.begin(), out.end(),
            [](const Cell& a, const Cell& b) { return a.gain() > b.gain(); });
  return out;
}

}  // namespace beltgrip::diagnose
