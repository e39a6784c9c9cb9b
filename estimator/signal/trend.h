// The slow course of one channel and its noise. Real-time thread; all memory is taken by the
// constructor.
//
// The course is a straight line through the longest stretch of the past, up to now, that the data
// let pass as one, given the noise that they show themselves. There is no threshold to tune: how
// long the line may be follows from noise and curvature. Values come in cells of 50 ms. Running
// sums make the line through any stretch of cells a matter of a few operations; the stretch is
// grown by half its length as long as none of its parts leaves the line by more than its noise
// allows.
//
// The noise is read off second differences of neighbouring means, which a straight line does not
// reach, for means of 1, 2, 4, ... cells. Of noise, longer means scatter less, or as much where it
// is rounding; where they scatter more, the course bends: then no line is longer than three of the
// means that do not show it yet, and they alone say what is noise.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace beltgrip::estimator {

struct Line {  // y = value + slope (t - t_s)
  double t_s = 0.0;
  double value = 0.0;
  double slope = 0.0;
  double value_variance = 0.0;  // at t_s, the middle of the stretch: independent of the slope's
  double slope_variance = 0.0;
  double begin_s = 0.0;
  bool valid = false;
  double at(double t) const noexcept { return value + slope * (t - t_s); }
  double variance_at(double t) const noexcept {
    return value_variance + slope_variance * (t - t_s) * (t - t_s);
  }
};

// Straight but for corners and steps; or it bends, as a force that is lowered more slowly near the
// top of friction.
enum class Course : std::uint8_t { kStraight, kBends };

class Trend {
 public:
  // cells: how many are kept.
  Trend(double sample_rate_hz, std::size_t cells, Course course = Course::kStraight);
  void reset() noexcept;
  // One sample. Where slip moves, the value may follow it: such stretches teach nothing about
  // noise. True when a cell was completed.
  bool step(double t_s, double value, double slip_percent) noexcept;
  // How far means over this time scatter about a straight line, times that time: the density of the
  // white noise that would scatter as much. The largest that any shorter time shows too, so that
  // noise that is correlated from sample to sample (frames slower than samples, rounding) counts
  // for what it is.
  double density(double over_s) const noexcept;
  // The same by the medians, which know nothing of a few corners and steps; less precise.
  double quiet_density(double over_s) const noexcept;
  // How many differences of means over this time have been seen.
  double squares(double over_s) const noexcept;
  // Variance of the error that readings close in time share (slow_noise.h): without variation that
  // slip follows in proportion, which is the load's own.
  double slow_variance() const noexcept;
  double cell_s() const noexcept { return cell_s_; }
  // The longest line that ends now. Not valid before a few cells have come.
  Line line() const noexcept;

 private:
  struct Sums {  // of all cells before this one, relative to the first
    double t = 0.0, y = 0.0, tt = 0.0, ty = 0.0;
  };
  struct Squares {
    struct Bin {
      double count = 0.0, sum = 0.0;
    };
    std::array<Bin, 64> bins{};  // by their power of two
    int first_bin = 0, last_bin = 0;
    double count = 0.0;
    void take(double square) noexcept;
    double median() const noexcept;
  };
  struct Scale {  // second differences of means over 2^i cells
    double sum = 0.0, slip_sum_percent = 0.0;
    int filled = 0;
    int count = 0;
    std::array<double, 3> means{};
    std::array<double, 3> slips_percent{};
    Squares squares;
    double mean_square = 0.0;
    // Without what the load's own variation makes of it, which slip follows.
    Squares without_slip;
    double slip_square_percent2 = 0.0,
           slip_cross = 0.0;  // sums: of slip's differences, by the value's
    void take(double second, double slip_second_percent) noexcept;
  };
  static constexpr int kScales = 9;  // up to 256 cells
  void add(double t_s, double value, double slip_percent) noexcept;
  double slow_variance_of(Squares Scale::*squares) const noexcept;
  // Of one that is kept: without a division, and without the library's look at the index.
  const Sums& sums(std::size_t cell) const noexcept {
    const std::size_t before = cell >= round_ ? 0 : sums_.size();
    return sums_.data()[cell + before - round_];
  }
  Line through(std::size_t begin, std::size_t end, double cell_variance) const noexcept;
  bool fits(const Line& line, std::size_t begin, std::size_t end,
            double cell_variance) const noexcept;
  int first_bent_scale() const noexcept;  // kScales: none
  double mean_deviation(const Line& line, std::size_t begin, std::size_t end) const noexcept;

  std::vector<Sums> sums_;
  std::size_t cells_ = 0;  // so far
  std::size_t round_ = 0;  // the one that stands first in sums_
  double origin_t_ = 0.0, origin_y_ = 0.0;
  Course course_;
  int per_cell_;
  double cell_s_;
  int filled_ = 0;
  double sum_t_ = 0.0, sum_y_ = 0.0, sum_slip_percent_ = 0.0;
  std::array<Scale, kScales> scales_;
};

}  // namespace beltgrip::estimator
