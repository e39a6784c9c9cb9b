// No function takes or gives lanes once all is inline: there is no calling convention to change.
#pragma GCC diagnostic ignored "-Wpsabi"
#include "tools/diagnose/infer/foot_points.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "tools/diagnose/model/curve_lanes.h"

namespace beltgrip::diagnose {

namespace {
constexpr double kStepMost = 0.5;  // in slips at the peak
constexpr double kShorter = 0.4;   // times, where the distance would grow
constexpr double kNoStep = 1e-5;   // the distance is flat there
constexpr int kIterations = 12, kHalvings = 6;
constexpr double kBendStep = 0.05;      // in slips at the peak
constexpr double kSpreadLeast = 1e-10;  // squared shares: less is nothing on the steepest curve
}  // namespace

void FootBatch::find_one(std::size_t i) {
  const double slip = slip_[i], capacity_Nm = capacity_Nm_[i];
  const auto [slip_weight, torque_weight, tilt_Nm] = independent(i);
  // What the mean of the curve over a sample is more than the curve at the mean slip, Nm.
  double bend_Nm = 0.0;
  if (!(slip_spread_[i] < kSpreadLeast)) {
    const double x = slip * per_peak_;
    const double bend =
        (curve_.evaluate(x + kBendStep).slope - curve_.evaluate(x - kBendStep).slope) /
        (2.0 * kBendStep);
    bend_Nm = 0.5 * capacity_Nm * bend * slip_spread_[i] * per_peak_ * per_peak_;
  }
  const double torque_Nm = torque_Nm_[i] - bend_Nm;
  struct CurvePoint {
    double x = 0.0, model_Nm = 0.0, slope = 0.0, distance = 0.0;
  };
  const auto at = [&](double x) -> CurvePoint {
    const CurveShape::Point point = curve_.evaluate(x);
    const double model_Nm = capacity_Nm * point.value;
    const double gap_slip = slip - x * peak_;
    const double gap_Nm = torque_Nm - model_Nm - tilt_Nm * gap_slip;
    return {x, model_Nm, capacity_Nm * point.slope * per_peak_,
            gap_slip * gap_slip * slip_weight + gap_Nm * gap_Nm * torque_weight};
  };
  CurvePoint foot = at(slip * per_peak_);
  // Right of the rising branch the next point of the curve may lie on it, at the same torque:
  // from beyond the peak no small steps lead there.
  if (const double rising = nominal_inverse(torque_Nm / capacity_Nm); std::isfinite(rising)) {
    if (const CurvePoint there = at(rising); there.distance < foot.distance) foot = there;
  }
  // Gauss-Newton, the step shortened while the distance would grow.
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const double gap_slip = slip - foot.x * peak_;
    const double gap_Nm = torque_Nm - foot.model_Nm - tilt_Nm * gap_slip;
    const double slope = foot.slope - tilt_Nm;
    double step = (gap_slip * slip_weight + slope * gap_Nm * torque_weight) /
                  ((slip_weight + slope * slope * torque_weight) * peak_);
    step = std::clamp(step, -kStepMost, kStepMost);
    const double before = foot.x;
    for (int halving = 0; halving < kHalvings; ++halving, step *= kShorter) {
      if (const CurvePoint there = at(before + step); there.distance <= foot.distance) {
        foot = there;
        break;
      }
    }
    if (std::abs(foot.x - before) < kNoStep) break;
  }
  x_[i] = foot.x;
  model_Nm_[i] = foot.model_Nm;
  slope_[i] = foot.slope;
  const auto variance_Nm2 = [&](double slope, double force_Nm) {
    return torque_variance_[i] + slope * slope * slip_variance_[i] + force_Nm * force_Nm;
  };
  const double force_Nm = of_force_Nm(i);
  const double gap_Nm = torque_Nm - foot.model_Nm - foot.slope * (slip - foot.x * peak_);
  const double off =
      reading_share_ * force_share_[i] * force_Nm * gap_Nm / variance_Nm2(foot.slope, force_Nm);
  calm_[i] = 1.0 + std::clamp(off, -kMoveMost, kMoveMost);
  slope_[i] = foot.slope * calm_[i];
  weight_[i] = 1.0 / std::sqrt(variance_Nm2(slope_[i], of_force_Nm(i)));
  value_[i] = gap_Nm * weight_[i];
}

void FootBatch::find_simply() {
  for (std::size_t i = 0; i < count_; ++i) find_one(i);
}

// The same in lanes, for all samples of a batch. Those that are still searched for stand together
// at the front.
template <typename Lanes>
class FootSearch {
 public:
  using Curve = CurveLanes<Lanes>;
  using Value = typename Curve::Value;
  using Mask = typename Curve::Mask;
  static constexpr std::size_t kCount = Curve::kCount;
  static constexpr std::size_t kMost = FootBatch::kMost;

  BELTGRIP_LANES explicit FootSearch(FootBatch& batch) : batch_(batch), curve_(batch.curve_) {}

  BELTGRIP_LANES void run() {
    for (std::size_t i = batch_.count_; i % kCount != 0; ++i) fill_up(i);
    for (std::size_t i = 0; i < batch_.count_; i += kCount) begin(i);
    std::size_t left = batch_.count_;
    for (std::size_t i = 0; i < left; ++i) sample_[i] = i;
    while (left > 0) {
      for (std::size_t i = 0; i < left; i += kCount) step(i);
      for (std::size_t i = left; i-- > 0;) {
        if (!ends_[i]) continue;
        take(i);
        move(--left, i);
      }
    }
    for (std::size_t i = 0; i < batch_.count_; i += kCount) weigh(i);
    for (std::size_t i = 0; i < batch_.count_; ++i) {
      if (is_odd_[i]) batch_.find_one(i);
    }
  }

 private:
  using Column = FootBatch::Column;
  using Flags = std::array<std::int64_t, kMost>;

  BELTGRIP_LANES static Value load(const Column& from, std::size_t i) {
    Value out;
    std::memcpy(&out, from.data() + i, sizeof out);
    return out;
  }
  BELTGRIP_LANES static void store(Value value, Column& to, std::size_t i) {
    std::memcpy(to.data() + i, &value, sizeof value);
  }
  BELTGRIP_LANES static void store(Mask value, Flags& to, std::size_t i) {
    std::memcpy(to.data() + i, &value, sizeof value);
  }

  BELTGRIP_LANES static bool any(Mask lanes) {
    std::int64_t all = 0;
    for (std::size_t lane = 0; lane < kCount; ++lane) all |= lanes[lane];
    return all != 0;
  }

  // Behind the last sample: lanes that are counted nowhere.
  BELTGRIP_LANES void fill_up(std::size_t i) {
    batch_.slip_[i] = batch_.torque_Nm_[i] = batch_.slip_spread_[i] = 0.0;
    batch_.force_share_[i] = batch_.slip_of_force_[i] = 0.0;
    batch_.capacity_Nm_[i] = batch_.slip_variance_[i] = batch_.torque_variance_[i] = 1.0;
    batch_.x_[i] = batch_.model_Nm_[i] = batch_.slope_[i] = 0.0;
  }

  struct Sample {
    Value slip, torque_Nm, capacity_Nm, slip_weight, torque_weight, tilt_Nm;
  };
  struct CurvePoint {
    Value x, model_Nm, slope, distance;
  };
  BELTGRIP_LANES CurvePoint at(const Sample& sample, Value x) const {
    const typename Curve::Point point = curve_.evaluate(x);
    const Value model_Nm = sample.capacity_Nm * point.value;
    const Value gap_slip = sample.slip - x * batch_.peak_;
    const Value gap_Nm = sample.torque_Nm - model_Nm - sample.tilt_Nm * gap_slip;
    return {x, model_Nm, sample.capacity_Nm * point.slope * batch_.per_peak_,
            gap_slip * gap_slip * sample.slip_weight + gap_Nm * gap_Nm * sample.torque_weight};
  }
  BELTGRIP_LANES static CurvePoint chosen(Mask first, const CurvePoint& a, const CurvePoint& b) {
    return {first ? a.x : b.x, first ? a.model_Nm : b.model_Nm, first ? a.slope : b.slope,
            first ? a.distance : b.distance};
  }
  BELTGRIP_LANES Value step_from(const Sample& sample, const CurvePoint& foot) const {
    const Value weight = sample.slip_weight, slope = foot.slope - sample.tilt_Nm;
    const Value gap_slip = sample.slip - foot.x * batch_.peak_;
    const Value gap_Nm = sample.torque_Nm - foot.model_Nm - sample.tilt_Nm * gap_slip;
    const Value step = (gap_slip * weight + slope * gap_Nm * sample.torque_weight) /
                       ((weight + slope * slope * sample.torque_weight) * batch_.peak_);
    const Value least = Value{} - kStepMost, most = Value{} + kStepMost;
    return step < least ? least : step > most ? most : step;
  }

  BELTGRIP_LANES void begin(std::size_t i) {
    const Value capacity_Nm = load(batch_.capacity_Nm_, i), spread = load(batch_.slip_spread_, i);
    for (std::size_t lane = i; lane < i + kCount; ++lane) {
      const FootBatch::Independent by = batch_.independent(lane);
      slip_weight_[lane] = by.slip_weight;
      torque_weight_[lane] = by.torque_weight;
      tilt_Nm_[lane] = by.tilt_Nm;
    }
    Sample sample{load(batch_.slip_, i), load(batch_.torque_Nm_, i), capacity_Nm,
                  load(slip_weight_, i), load(torque_weight_, i),    load(tilt_Nm_, i)};
    const Value x = sample.slip * batch_.per_peak_;
    const Value above = x + kBendStep, below = x - kBendStep;
    if (any(~(spread < kSpreadLeast))) {
      const Value bend =
          (curve_.evaluate(above).slope - curve_.evaluate(below).slope) / (2.0 * kBendStep);
      const Value bend_Nm = 0.5 * capacity_Nm * bend * spread * batch_.per_peak_ * batch_.per_peak_;
      sample.torque_Nm -= spread < kSpreadLeast ? Value{} : bend_Nm;
    }
    const CurvePoint here = at(sample, x);
    const Value height = sample.torque_Nm / capacity_Nm;
    const Value rising = curve_.nominal_inverse(height);
    const CurvePoint there = at(sample, rising);
    const Mask is_nearer = Curve::has_inverse(height) & (there.distance < here.distance);
    const CurvePoint foot = chosen(is_nearer, there, here);
    store(Curve::is_beyond(x) | Curve::is_beyond(above) | Curve::is_beyond(below), is_odd_, i);
    store(sample.slip, slip_, i);
    store(sample.torque_Nm, torque_Nm_, i);
    store(sample.torque_Nm, level_Nm_, i);
    store(sample.capacity_Nm, capacity_Nm_, i);
    keep(foot, i);
    store(step_from(sample, foot), step_, i);
    store(Value{}, halvings_, i);
    store(Value{}, iterations_, i);
  }

  BELTGRIP_LANES void keep(const CurvePoint& foot, std::size_t i) {
    store(foot.x, x_, i);
    store(foot.model_Nm, model_Nm_, i);
    store(foot.slope, slope_, i);
    store(foot.distance, distance_, i);
  }

  BELTGRIP_LANES void step(std::size_t i) {
    const Sample sample{load(slip_, i),        load(torque_Nm_, i),     load(capacity_Nm_, i),
                        load(slip_weight_, i), load(torque_weight_, i), load(tilt_Nm_, i)};
    const CurvePoint before{load(x_, i), load(model_Nm_, i), load(slope_, i), load(distance_, i)};
    const Value tried = load(step_, i);
    const CurvePoint there = at(sample, before.x + tried);
    const Mask is_nearer = there.distance <= before.distance;
    const CurvePoint foot = chosen(is_nearer, there, before);
    const Value halvings = load(halvings_, i) + 1.0;
    const Mask turns = is_nearer | (halvings == static_cast<double>(kHalvings));
    const Value iterations = load(iterations_, i) + (turns ? Value{} + 1.0 : Value{});
    const Mask is_flat = Curve::size_of(foot.x - before.x) < kNoStep;
    const Mask is_beyond = Curve::is_beyond(there.x);
    store((turns & (is_flat | (iterations == static_cast<double>(kIterations)))) | is_beyond, ends_,
          i);
    store(is_beyond, is_beyond_, i);
    keep(foot, i);
    store(turns ? step_from(sample, foot) : tried * kShorter, step_, i);
    store(turns ? Value{} : halvings, halvings_, i);
    store(iterations, iterations_, i);
  }

  BELTGRIP_LANES void take(std::size_t i) {
    const std::size_t sample = sample_[i];
    batch_.x_[sample] = x_[i];
    batch_.model_Nm_[sample] = model_Nm_[i];
    batch_.slope_[sample] = slope_[i];
    is_odd_[sample] |= is_beyond_[i];
  }
  BELTGRIP_LANES void move(std::size_t from, std::size_t to) {
    const auto each = [&](Column& column)
                          BELTGRIP_INLINE { column.data()[to] = column.data()[from]; };
    each(slip_), each(torque_Nm_), each(capacity_Nm_);
    each(slip_weight_), each(torque_weight_), each(tilt_Nm_);
    each(x_), each(model_Nm_), each(slope_), each(distance_);
    each(step_), each(halvings_), each(iterations_);
    sample_[to] = sample_[from];
  }

  BELTGRIP_LANES void weigh(std::size_t i) {
    const Value share = load(batch_.force_share_, i), model_Nm = load(batch_.model_Nm_, i);
    const Value slip_of_force = load(batch_.slip_of_force_, i);
    const Value torque_Nm2 = load(batch_.torque_variance_, i);
    const Value slip_share2 = load(batch_.slip_variance_, i);
    const auto force_Nm = [&](Value slope)
                              BELTGRIP_INLINE { return model_Nm * share - slope * slip_of_force; };
    const auto variance_Nm2 = [&](Value slope, Value by_force_Nm) BELTGRIP_INLINE {
      return torque_Nm2 + slope * slope * slip_share2 + by_force_Nm * by_force_Nm;
    };
    const Value slope = load(batch_.slope_, i), by_force_Nm = force_Nm(slope);
    const Value gap_Nm = load(level_Nm_, i) - model_Nm -
                         slope * (load(batch_.slip_, i) - load(batch_.x_, i) * batch_.peak_);
    const Value off =
        batch_.reading_share_ * share * by_force_Nm * gap_Nm / variance_Nm2(slope, by_force_Nm);
    const Value least = Value{} - FootBatch::kMoveMost, most = Value{} + FootBatch::kMoveMost;
    const Value calm = 1.0 + (off < least ? least : off > most ? most : off);
    const Value calm_slope = slope * calm;
    const Value weight = 1.0 / Curve::root(variance_Nm2(calm_slope, force_Nm(calm_slope)));
    store(calm, batch_.calm_, i);
    store(calm_slope, batch_.slope_, i);
    store(weight, batch_.weight_, i);
    store(gap_Nm * weight, batch_.value_, i);
  }

  FootBatch& batch_;
  Curve curve_;
  alignas(64) Column slip_, torque_Nm_, capacity_Nm_;
  alignas(64) Column slip_weight_, torque_weight_, tilt_Nm_;
  alignas(64) Column x_, model_Nm_, slope_, distance_, step_, halvings_, iterations_;
  alignas(64) Flags ends_, is_beyond_;
  std::array<std::size_t, kMost> sample_;
  // By sample: its torque less the bend; the search left the table.
  alignas(64) Column level_Nm_;
  alignas(64) Flags is_odd_;
};

namespace {
void find_by_two(FootBatch& batch) { FootSearch<LanesOf<2>>(batch).run(); }
BELTGRIP_FOUR void find_by_four(FootBatch& batch) { FootSearch<LanesOf<4>>(batch).run(); }
}  // namespace

void FootBatch::find() {
  static const bool kHasFour = has_four();
  if (!CurveLanes<LanesOf<2>>::can(curve_)) {
    find_simply();
  } else if (kHasFour) {
    find_by_four(*this);
  } else {
    find_in_pairs();
  }
}

void FootBatch::find_in_pairs() { find_by_two(*this); }

}  // namespace beltgrip::diagnose
