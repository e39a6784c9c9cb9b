// What is measured in the moment after the stop, while the clamp force still lies where it was: a
// belt beyond its peak goes on down its curve until the force is back. Real-time thread; all memory
// is taken by the constructor.
#pragma once

#include <cstddef>
#include <vector>

#include "estimator/record/experiment_record.h"

namespace beltgrip::estimator {

class AfterStop {
 public:
  explicit AfterStop(double sample_rate_hz);
  void reset() noexcept;
  // The stop has been decided, with this record.
  void begin(const ExperimentRecord& record) noexcept;
  // One sample after it, its pressure foretold for so long. Kept until the force rises, slip has
  // run away or time is over, and only what a later reading of the pressure has shown to lie before
  // that.
  void step(const Cell& sample, double pressure_ahead_s) noexcept;
  // Nothing more is kept.
  bool over() const noexcept { return over_; }
  // The samples of the curve, oldest first.
  std::size_t size() const noexcept { return kept_; }
  const Cell& operator[](std::size_t i) const noexcept { return samples_[i]; }
  // Slip that rattles swings back at once, while the force lies where it was; a belt that slips
  // does not.
  bool swung_back() const noexcept;

 private:
  void judge_group() noexcept;
  void count_read(double read_to_s) noexcept;

  std::vector<Cell> samples_;
  std::size_t per_group_;
  std::size_t count_ = 0, read_ = 0, kept_ = 0, group_begin_ = 0;
  std::size_t read_before_group_ = 0;
  bool begun_ = false, over_ = false;
  double stop_t_s_ = 0.0, stop_slip_percent_ = 0.0, force_limit_N_ = 0.0;
  double slip_before_percent_ = 0.0, slip_at_end_percent_ = 0.0, slip_noise_percent2_s_ = 0.0;
  double swing_slip_percent_ = 0.0;  // sum
  int swing_samples_ = 0;
};

}  // namespace beltgrip::estimator
