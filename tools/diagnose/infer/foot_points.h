// The foot point of a sample: the point of the friction curve that is nearest to its slip and
// torque, each in units of its noise.
#pragma once

#include <array>
#include <cstddef>

#include "tools/diagnose/model/variator_model.h"

namespace beltgrip::diagnose {

// Samples at one end stop, taken many at a time: a step of all before the next. One sample's steps
// wait for each other, those of different samples do not.
class FootBatch {
 public:
  static constexpr std::size_t kMost = 128;
  using Column = std::array<double, kMost>;

  FootBatch(const CurveShape& curve, double peak_slip_share, double slip_variance_share2)
      : curve_(curve),
        peak_(peak_slip_share),
        per_peak_(1.0 / peak_slip_share),
        slip_variance_(slip_variance_share2),
        slip_weight_(1.0 / slip_variance_share2) {}

  // slip_spread_share2: by how much the slip varies within the sample.
  void add(double slip_share, double torque_Nm, double capacity_Nm, double slip_spread_share2,
           double torque_variance) {
    slip_[count_] = slip_share;
    torque_Nm_[count_] = torque_Nm;
    capacity_Nm_[count_] = capacity_Nm;
    slip_spread_[count_] = slip_spread_share2;
    torque_variance_[count_] = torque_variance;
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
  double slope(std::size_t i) const { return slope_[i]; }    // dT/d(slip)
  double weight(std::size_t i) const { return weight_[i]; }  // 1 / (noise of the distance)
  double value(std::size_t i) const { return value_[i]; }    // the distance, in units of its noise

 private:
  template <typename Lanes>
  friend class FootSearch;
  void find_one(std::size_t i);

  const CurveShape& curve_;
  double peak_, per_peak_, slip_variance_, slip_weight_;
  std::size_t count_ = 0;
  alignas(64) Column slip_, torque_Nm_, capacity_Nm_, slip_spread_, torque_variance_;
  alignas(64) Column x_, model_Nm_, slope_, weight_, value_;
};

}  // namespace beltgrip::diagnose
