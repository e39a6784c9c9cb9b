#include "estimator/trend.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::estimator {
namespace {

constexpr double kContradiction = 3.0;  // deviations by which a part may leave the line
constexpr double kNoiseScale_s = 0.4;   // longer means scatter by what is not noise
constexpr std::size_t kShortest = 4;    // cells in the first line

}  // namespace

Trend::Trend(std::size_t cells) : sums_(cells + 1) {}

void Trend::reset() noexcept {
  cells_ = 0;
  weight_ = sum_t_ = sum_y_ = 0.0;
  for (Scale& scale : scales_) scale = {};
}

void Trend::step(double t_s, double value, double duration_s) noexcept {
  sum_t_ += t_s * duration_s;
  sum_y_ += value * duration_s;
  weight_ += duration_s;
  if (weight_ < kCell_s - 1e-9) return;
  add(sum_t_ / weight_, sum_y_ / weight_);
  weight_ = sum_t_ = sum_y_ = 0.0;
}

void Trend::add(double t_s, double value) noexcept {
  if (cells_ == 0) {
    origin_t_ = t_s;
    origin_y_ = value;
    sums_[0] = {};
  }
  const double t = t_s - origin_t_;
  const double y = value - origin_y_;
  const Sums& before = sums(cells_);
  Sums& after = sums_[(cells_ + 1) % sums_.size()];
  after = {before.t + t, before.y + y, before.tt + t * t, before.ty + t * y, before.yy + y * y};
  ++cells_;
  for (int i = 0; i < kScales; ++i) {
    Scale& scale = scales_[i];
    scale.sum += y;
    if (++scale.filled < (1 << i)) continue;
    scale.means[0] = scale.means[1];
    scale.means[1] = scale.means[2];
    scale.means[2] = scale.sum / scale.filled;
    scale.sum = 0.0;
    scale.filled = 0;
    if (++scale.count < 3) continue;
    const double second = scale.means[0] - 2.0 * scale.means[1] + scale.means[2];
    scale.squares += second * second / 6.0;
    scale.degrees += 0.5;  // neighbours share means: about half as many independent ones
  }
}

double Trend::density(double over_s) const noexcept {
  double largest = 0.0;
  for (int i = 0; i < kScales; ++i) {
    const Scale& scale = scales_[i];
    const double length_s = kCell_s * (1 << i);
    if (i > 0 && (scale.degrees < 3.0 || length_s > over_s)) break;
    if (scale.degrees > 0.0) {
      largest = std::max(largest, scale.squares / (2.0 * scale.degrees) * length_s);
    }
  }
  return largest;
}

Line Trend::through(std::size_t begin, std::size_t end) const noexcept {
  const Sums& a = sums(begin);
  const Sums& b = sums(end);
  const double n = static_cast<double>(end - begin);
  const double t = (b.t - a.t) / n;
  const double y = (b.y - a.y) / n;
  const double tt = std::max(1e-12, (b.tt - a.tt) - n * t * t);
  const double ty = (b.ty - a.ty) - n * t * y;
  const double variance = density(kNoiseScale_s) / kCell_s;
  Line line;
  line.t_s = origin_t_ + t;
  line.value = origin_y_ + y;
  line.slope = ty / tt;
  line.value_variance = variance / n;
  line.slope_variance = variance / tt;
  line.valid = true;
  return line;
}

double Trend::mean_deviation(const Line& line, std::size_t begin, std::size_t end) const noexcept {
  const Sums& a = sums(begin);
  const Sums& b = sums(end);
  const double n = static_cast<double>(end - begin);
  return origin_y_ + (b.y - a.y) / n - line.at(origin_t_ + (b.t - a.t) / n);
}

Line Trend::line(double t_s) const noexcept {
  const std::size_t oldest = cells_ >= sums_.size() ? cells_ - sums_.size() + 1 : 0;
  std::size_t end = cells_;
  // Cells are about kCell_s apart; the estimate is corrected cell by cell.
  while (end > oldest + kShortest) {
    const double last_t = origin_t_ + sums(end).t - sums(end - 1).t;
    if (last_t + 0.5 * kCell_s <= t_s + 1e-9) break;
    const double ahead = (last_t + 0.5 * kCell_s - t_s) / kCell_s;
    const auto jump = static_cast<std::size_t>(std::max(1.0, std::floor(0.8 * ahead)));
    end = end - std::min(jump, end - oldest - kShortest);
  }
  Line best;
  if (end < oldest + kShortest) return best;
  const double variance = density(kNoiseScale_s) / kCell_s;
  std::size_t length = kShortest;
  best = through(end - length, end);
  std::size_t accepted = length;
  while (end - length > oldest) {
    length = std::min(end - oldest, length + std::max<std::size_t>(2, length / 2));
    const Line candidate = through(end - length, end);
    bool fits = true;
    // Parts at both ends and of every size: 4, 8, 16, ... cells, and what is new.
    for (std::size_t part = kShortest; part < length && fits; part *= 2) {
      const double bound = kContradiction * std::sqrt(variance / static_cast<double>(part)) + 1e-12;
      fits = std::abs(mean_deviation(candidate, end - part, end)) < bound &&
             std::abs(mean_deviation(candidate, end - length, end - length + part)) < bound;
    }
    if (fits) {
      const std::size_t middle = length / 3;
      const double bound =
          kContradiction *
          std::sqrt(variance / static_cast<double>(std::max<std::size_t>(1, middle)));
      fits = std::abs(mean_deviation(candidate, end - 2 * middle, end - middle)) < bound + 1e-12;
    }
    if (!fits) break;
    best = candidate;
    accepted = length;
  }
  best.begin_s = origin_t_ + sums(end - accepted + 1).t - sums(end - accepted).t;
  best.end_s = origin_t_ + sums(end).t - sums(end - 1).t;
  return best;
}

}  // namespace beltgrip::estimator
