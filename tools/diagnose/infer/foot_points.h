// The foot point of a sample: the point of the friction curve that is nearest to its slip and
// torque, by the noise of both.
#pragma once

#include <array>
#include <cstddef>

#include "tools/diagnose/model/variator_model.h"

namespace beltgrip::diagnose {

// One sample's. The clamp force's noise is a share of what the belt carries, and by the pulleys
// that give way to it a share of the slip too: both go up together.
struct FootNoise {
  double slip_share2 = 0.0, torque_Nm2 = 0.0;           // variances of the speeds and of the torque
  double force_share = 0.0, slip_share_of_force = 0.0;  // one sigma of the clamp force
};

// Samples at one end stop, taken many at a time: a step of all before the next. One sample's steps
// wait for each other, those of different samples do not.
class FootBatch {
 public:
  static constexpr std::size_t kMost = 128;
  // Chosen, of the clamp force: none is off by more. A fifth less or more: the same verdicts and
  // names in 70 campaigns of other make, other last digits in half of them.
  static constexpr double kMoveMost = 0.2;
  using Column = std::array<double, kMost>;

  // reading_share: of the clamp force's variance, what is noise of the samples.
  FootBatch(const CurveShape& curve, double peak_slip_share, double reading_share)
      : curve_(curve),
        peak_(peak_slip_share),
        per_peak_(1.0 / peak_slip_share),
        reading_share_(reading_share) {}

  // slip_spread_share2: by how much the slip varies within the sample.
  void add(double slip_share, double torque_Nm, double capacity_Nm, double slip_spread_share2,
           const FootNoise& noise) {
    slip_[count_] = slip_share;
    torque_Nm_[count_] = torque_Nm;
    capacity_Nm_[count_] = capacity_Nm;
    slip_spread_[count_] = slip_spread_share2;
    slip_variance_[count_] = noise.slip_share2;
    torque_variance_[count_] = noise.torque_Nm2;
    force_share_[count_] = noise.force_share;
    slip_of_force_[count_] = noise.slip_share_of_force;
    ++count_;
  }
  void find();  // by the widest registers there are
  // The same by those that any processor has; of a curve without a fall.
  void find_in_pairs();
  // The same one by one, in the order of thought: what the others are held against.
  void find_simply();

  std::size_t count() const { return count_; }
  double x(std::size_t i) const { return x_[i]; }
  double model_Nm(std::size_t i) const { return model_Nm_[i]; }
  // The clamp force less what of the distance is its samples' noise, over that which is measured.
  // That noise in slopes, and so in weights, would stand in all columns of a fit, and where most of
  // the distance is such noise they would together explain it.
  double calm(std::size_t i) const { return calm_[i]; }
  double slope(std::size_t i) const { return slope_[i]; }    // dT/d(slip), by the calm force
  double weight(std::size_t i) const { return weight_[i]; }  // 1 / (noise of the distance)
  // What of that noise one sigma of the clamp force is, Nm.
  double of_force_Nm(std::size_t i) const {
    return model_Nm_[i] * force_share_[i] - slope_[i] * slip_of_force_[i];
  }
  double value(std::size_t i) const { return value_[i]; }  // the distance, in units of its noise

 private:
  template <typename Lanes>
  friend class FootSearch;
  void find_one(std::size_t i);
  // To search by: the clamp force carries what is measured. In the noise of the distance it carries
  // what it does at the foot point: by what is measured, less friction would fit better for
  // dividing the force's noise.
  struct Independent {
    double slip_weight, torque_weight, tilt_Nm;  // the torque less the tilt times the slip
  };
  Independent independent(std::size_t i) const {
    const double carried_Nm = torque_Nm_[i] * force_share_[i];
    const double slip_variance = slip_variance_[i] + slip_of_force_[i] * slip_of_force_[i];
    const double together = carried_Nm * slip_of_force_[i], tilt_Nm = together / slip_variance;
    return {1.0 / slip_variance,
            1.0 / (torque_variance_[i] + carried_Nm * carried_Nm - tilt_Nm * together), tilt_Nm};
  }

  const CurveShape& curve_;
  double peak_, per_peak_, reading_share_;
  std::size_t count_ = 0;
  alignas(64) Column slip_, torque_Nm_, capacity_Nm_, slip_spread_;
  alignas(64) Column slip_variance_, torque_variance_, force_share_, slip_of_force_;
  alignas(64) Column x_, model_Nm_, slope_, calm_, weight_, value_;
};

}  // namespace beltgrip::diagnose
