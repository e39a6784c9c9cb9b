#include "tools/diagnose/infer/cells.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
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

// Of one sigma of the rounding. Measured, six healthy campaigns of other make whose pressure swings
// between steps of 40 kPa, as no course that passes them says: 0.23 to 0.39. A fifth less or more:
// the same verdicts in 16 campaigns.
constexpr double kSwingsLeft = 0.3;

// Squared, in sigmas, of all samples: what swings of a pressure that rests on its steps leave in
// the friction. Slip and speed follow them, and the reading does not: so they are functions of a
// speed.
double pressure_left_of(const Engine& engine, const CellBase& base) {
  const Campaign& campaign = engine.campaign();
  const estimator::VariatorParameters& variator = campaign.variator;
  double out = 0.0;
  for (std::size_t i = 0; i < base.runs.size(); ++i) {
    const auto run = static_cast<std::size_t>(base.runs[i]);
    const ExperimentData& data = campaign.runs[run];
    if (data.rests_pressure.empty()) continue;
    QuantityChange left;
    left.ln_capacity = kSwingsLeft * variator.secondary_piston_area_m2 * data.rounding_pressure_Pa /
                       base.at[i].there.force_N.max(50.0);
    RawColumns column;
    column.columns.push_back(valid_rows(data, propagate(campaign, base.at[i], left)));
    out += summary_of(campaign, base.runs[i], column, engine.whitening()).aa(0, 0);
  }
  return out;
}

bool is_left_of_pressure(double left, const Cell& cell, const Campaign& campaign) {
  const bool is_seen_behind =
      campaign.has_balance && (cell.injection->injection == Injection::kTorque ||
                               cell.injection->injection == Injection::kTorqueGain);
  if (is_seen_behind) return false;
  return cell.mean.dot(cell.scores.front().information * cell.mean) < left;
}

// Any form that friction over slip may have beside the family's: a function of the slip over that
// at the peak. None where no sample counts.
std::optional<Abscissa> form_of_friction(const Campaign& campaign, const CellBase& base) {
  // Of all, the outermost: as of every other variable. A fifth less or more: the same verdicts in
  // seven campaigns of other make whose functions of the time it decides about.
  constexpr std::size_t kTail = 100;
  Abscissa out;
  out.x.resize(campaign.runs.size());
  std::vector<double> all;
  for (std::size_t i = 0; i < base.runs.size(); ++i) {
    const auto run = static_cast<std::size_t>(base.runs[i]);
    const Eigen::ArrayXd& foot = base.at[i].foot;
    out.x[run] = foot;
    for (Eigen::Index k = 0; k < foot.size(); ++k) {
      if (campaign.runs[run].valid[static_cast<std::size_t>(k)]) all.push_back(foot[k]);
    }
  }
  if (all.empty()) return {};
  std::sort(all.begin(), all.end());
  out.low = all[all.size() / kTail];
  out.high = all[all.size() - 1 - all.size() / kTail];
  if (!(out.high > out.low)) return {};
  for (Eigen::ArrayXd& x : out.x) {
    x = ((x - out.low) / (out.high - out.low)).max(0.0).min(1.0);
  }
  return out;
}

// A ramp goes up the curve in time: what another form of friction explains as well follows the
// slip, not the time.
void drop_time_by_form(const Engine& engine, CellBase& base, std::vector<Cell>& cells) {
  const auto is_time = [](const Cell& cell) {
    return std::string_view(cell.abscissa.variable->name) == "time";
  };
  if (std::none_of(cells.begin(), cells.end(), is_time)) return;
  const std::optional<Abscissa> slip = form_of_friction(engine.campaign(), base);
  if (!slip) return;
  const InjectionRow& friction =
      *std::find_if(kInjections.begin(), kInjections.end(),
                    [](const InjectionRow& row) { return row.injection == Injection::kFriction; });
  Cell form;
  form.scores = scores_of(cell_columns(engine, base, *slip, friction), base, KnotVector::Zero());
  judge_cell(form);
  std::erase_if(cells,
                [&](const Cell& cell) { return is_time(cell) && form.gain() >= cell.gain(); });
}

}  // namespace

std::vector<Cell> score_cells(const Engine& engine) {
  std::vector<Cell> out;
  if (engine.whitening().random.empty()) return out;  // stopped before the noise was known
  CellBase base = cell_base(engine);
  const HalfStep half = half_step(engine.campaign());
  const double pressure_left = pressure_left_of(engine, base);
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
      if (is_left_of_pressure(pressure_left, cell, engine.campaign())) continue;
      out.push_back(std::move(cell));
    }
  }
  drop_time_by_form(engine, base, out);
  std::sort(out.begin(), out.end(),
            [](const Cell& a, const Cell& b) { return a.gain() > b.gain(); });
  return out;
}

}  // namespace beltgrip::diagnose
