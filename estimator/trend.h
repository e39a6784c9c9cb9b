// The slow course of one channel: a straight line through the longest stretch of the past that the
// data let pass as one, given the noise that they show themselves. No threshold to tune: how long
// the line may be follows from noise and curvature. Real-time thread; all memory is taken by the
// constructor.
//
// Values come in cells of kCell_s. Running sums make the line through any stretch of cells a matter
// of a few operations; the stretch is grown by half its length as long as none of its parts leaves
// the line by more than its noise allows.
#pragma once

#include <cstddef>
#include <vector>

namespace beltgrip::estimator {

inline constexpr double kCell_s = 0.05;

struct Line {  // y = value + slope (t - t_s)
  double t_s = 0.0;
  double value = 0.0;
  double slope = 0.0;
  double value_variance = 0.0;  // at t_s, the middle of the stretch: independent of the slope's
  double slope_variance = 0.0;
  double begin_s = 0.0, end_s = 0.0;
  bool valid = false;
  double at(double t) const { return value + slope * (t - t_s); }
  double variance_at(double t) const {
    return value_variance + slope_variance * (t - t_s) * (t - t_s);
  }
};

class Trend {
 public:
  // cells: how many are kept.
  explicit Trend(std::size_t cells);
  void reset() noexcept;
  // One sample; duration_s: what it stands for.
  void step(double t_s, double value, double duration_s) noexcept;
  // How far means over this time scatter about a straight line, times that time: the density of
  // white noise that would scatter as much. The largest that any shorter time shows, so that noise
  // that is correlated from sample to sample (frames slower than samples, rounding) and true
  // variation count for what they are.
  double density(double over_s) const noexcept;
  // The longest line that ends at the last full cell before t_s.
  Line line(double t_s) const noexcept;

 private:
  struct Sums {  // of all cells before this one, relative to the first
    double t = 0.0, y = 0.0, tt = 0.0, ty = 0.0, yy = 0.0;
  };
  static constexpr int kScales = 9;  // 1, 2, 4, ... 256 cells
  struct Scale {
    double sum = 0.0;
    int filled = 0;
    double means[3] = {};
    int count = 0;
    double squares = 0.0;
    double degrees = 0.0;  // half the number of independent squares
  };
  void add(double t_s, double value) noexcept;
  const Sums& sums(std::size_t cell) const noexcept { return sums_[cell % sums_.size()]; }
  Line through(std::size_t begin, std::size_t end) const noexcept;
  double mean_deviation(const Line& line, std::size_t begin, std::size_t end) const noexcept;

  std::vector<Sums> sums_;
  std::size_t cells_ = 0;  // so far
  double origin_t_ = 0.0, origin_y_ = 0.0;
  double sum_t_ = 0.0, sum_y_ = 0.0, weight_ = 0.0;
  Scale scales_[kScales];
};

}  // namespace beltgrip::estimator
