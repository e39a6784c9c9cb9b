#include "tools/diagnose/data/unrounded.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "estimator/statistics/order.h"

namespace beltgrip::diagnose {
namespace {

// All but the first in steps of the rounding. Chosen where nothing else is said: what is left of
// ramps, waves, jumps and holds, with noise of 0.08 to 0.3 at 50 and 200 Hz, moves by less than a
// tenth with each of them a fifth less or more; kBendsPerMedian a fifth less leaves 17 % more of
// waves. (Measured with the noise begun at 0.1, where that a fifth less leaves 19 % more of holds.)
constexpr double kNode_s = 0.1;  // as far apart as the samples of an experiment
constexpr double kBendAtFirst = 0.01;
constexpr double kBendLeast = 0.002;     // of a course that is straight but for its corners
constexpr double kDegrees = 3.0;         // of Student's t: few bends are corners
constexpr double kBendsPerMedian = 1.5;  // derived: half of those of 3 degrees are below 0.76
constexpr double kNoiseAtFirst = 0.5;
constexpr double kNoiseLeast = 0.05, kNoiseMost = 1.0;  // beyond, no sample tells it
// Not settled: the noise of a clean ramp, 0.09, is told as 0.157 after so many passes, 0.135 after
// twice and 0.107 after five times as many. More of them are another noise, not a better course.
constexpr int kPasses = 20, kPassesSmooth = 5;
constexpr double kSettled = 1e-3;
constexpr double kTails = 4.0;  // derived, in sigmas: less than a ten thousandth is beyond

double density(double z) { return std::exp(-0.5 * z * z) / std::sqrt(2.0 * std::numbers::pi); }

// What a standard normal variable comes to within an interval.
struct Within {
  double mean = 0.0, variance = 1.0;
};
Within within(double low, double high) {
  constexpr double kFar = 6.0;  // derived: from there on nearly all of it is at the nearer end
  if (low + high < 0.0) {
    const Within mirrored = within(-high, -low);
    return {-mirrored.mean, mirrored.variance};
  }
  if (low > kFar) return {low + 1.0 / low, 1.0 / (low * low)};
  const double share =
      0.5 * (std::erfc(low / std::numbers::sqrt2) - std::erfc(high / std::numbers::sqrt2));
  const double at_low = density(low), at_high = density(high);
  const double mean = (at_low - at_high) / share;
  const double variance = 1.0 + (low * at_low - high * at_high) / share - mean * mean;
  return {mean, std::clamp(variance, 0.0, 1.0)};
}

struct Place {
  std::size_t node = 0;
  double share = 0.0;  // of the way to the next node
};

double at(const std::vector<double>& nodes, const Place& place) {
  return (1.0 - place.share) * nodes[place.node] + place.share * nodes[place.node + 1];
}

class Nodes {
 public:
  explicit Nodes(const Channel& channel)
      : start_s_(channel.t_s.front()),
        apart_s_(std::max(kNode_s, median_period_s(channel))),
        count_(static_cast<std::size_t>((channel.t_s.back() - start_s_) / apart_s_) + 2) {}
  std::size_t count() const { return count_; }
  Place of(double t_s) const {
    const double index = (t_s - start_s_) / apart_s_;
    const auto node = static_cast<std::size_t>(index);
    return {node, index - static_cast<double>(node)};
  }

 private:
  double start_s_, apart_s_;
  std::size_t count_;
};

// Samples of one value between two nodes; its place: their mean.
struct Group {
  Place place;
  double value = 0.0, count = 0.0;
};

std::vector<Group> groups_of(const Channel& channel, const Nodes& nodes, double step) {
  std::vector<Group> out;
  for (std::size_t i = 0; i < channel.value.size(); ++i) {
    const Place place = nodes.of(channel.t_s[i]);
    const double value = channel.value[i] / step;
    auto same = out.rbegin();
    while (same != out.rend() && same->place.node == place.node && same->value != value) ++same;
    if (same == out.rend() || same->place.node != place.node) {
      out.push_back({place, value, 1.0});
    } else {
      same->count += 1.0;
      same->place.share += (place.share - same->place.share) / same->count;
    }
  }
  return out;
}

// Symmetric, with two beside the diagonal; positive definite.
struct Banded {
  std::vector<double> diagonal, beside, second, right;
  explicit Banded(std::size_t n) : diagonal(n), beside(n), second(n), right(n) {}

  void add(const Place& place, double weight) {
    const double before = 1.0 - place.share;
    diagonal[place.node] += weight * before * before;
    diagonal[place.node + 1] += weight * place.share * place.share;
    beside[place.node] += weight * before * place.share;
  }
  void pull(const Place& place, double by) {
    right[place.node] += (1.0 - place.share) * by;
    right[place.node + 1] += place.share * by;
  }
  void add_bend(std::size_t k, double weight) {
    diagonal[k - 1] += weight;
    diagonal[k] += 4.0 * weight;
    diagonal[k + 1] += weight;
    beside[k - 1] -= 2.0 * weight;
    beside[k] -= 2.0 * weight;
    second[k - 1] += weight;
  }

  std::vector<double> solve() && {
    const std::size_t n = diagonal.size();
    for (std::size_t i = 0; i + 1 < n; ++i) {
      const double by = beside[i] / diagonal[i];
      const double by_second = second[i] / diagonal[i];
      diagonal[i + 1] -= by * beside[i];
      beside[i + 1] -= by * second[i];
      right[i + 1] -= by * right[i];
      if (i + 2 < n) {
        diagonal[i + 2] -= by_second * second[i];
        right[i + 2] -= by_second * right[i];
      }
      beside[i] = by;
      second[i] = by_second;
    }
    std::vector<double> out(n);
    for (std::size_t i = n; i-- > 0;) {
      out[i] = right[i] / diagonal[i];
      if (i + 1 < n) out[i] -= beside[i] * out[i + 1];
      if (i + 2 < n) out[i] -= second[i] * out[i + 2];
    }
    return out;
  }
};

// Of the noise within the interval that a value says.
Within noise_of(double value, double here, double sigma) {
  return within((value - 0.5 - here) / sigma, (value + 0.5 - here) / sigma);
}

double bend_of(const std::vector<double>& m, std::size_t k) {
  return m[k - 1] - 2.0 * m[k] + m[k + 1];
}

struct Course {
  std::vector<double> m;  // at the nodes
  double sigma = kNoiseAtFirst;
  double usual_bend = kBendAtFirst;
};

// As if rounding were noise, and bends were normal.
Course smooth(const std::vector<Group>& groups, std::size_t nodes) {
  Course out;
  Banded equations(nodes);
  for (const Group& group : groups) {
    const double weight = group.count / (out.sigma * out.sigma);
    equations.add(group.place, weight);
    equations.pull(group.place, weight * group.value);
  }
  for (std::size_t k = 1; k + 1 < nodes; ++k) {
    equations.add_bend(k, 1.0 / (out.usual_bend * out.usual_bend));
  }
  out.m = std::move(equations).solve();
  return out;
}

// One step of Newton's towards what is most probable; the noise and the usual bend from what it
// leaves. With normal bends there is one such course and no other.
Course improved(const Course& from, const std::vector<Group>& groups, bool normal_bends) {
  const std::size_t nodes = from.m.size();
  Banded equations(nodes);
  double squares = 0.0, samples = 0.0;
  for (const Group& group : groups) {
    const double here = at(from.m, group.place);
    const Within noise = noise_of(group.value, here, from.sigma);
    squares += group.count * (noise.mean * noise.mean + noise.variance);
    samples += group.count;
    const double told = group.count * (1.0 - noise.variance) / (from.sigma * from.sigma);
    equations.add(group.place, told);
    equations.pull(group.place, told * here + group.count * noise.mean / from.sigma);
  }
  for (std::size_t k = 1; k + 1 < nodes; ++k) {
    const double bend = bend_of(from.m, k) / from.usual_bend;
    const double weight = normal_bends ? 1.0 : (kDegrees + 1.0) / (kDegrees + bend * bend);
    equations.add_bend(k, weight / (from.usual_bend * from.usual_bend));
  }
  Course out = from;
  out.m = std::move(equations).solve();
  out.sigma = std::clamp(from.sigma * std::sqrt(squares / samples), kNoiseLeast, kNoiseMost);
  if (normal_bends) return out;
  std::vector<double> bends;
  for (std::size_t k = 1; k + 1 < nodes; ++k) bends.push_back(std::abs(bend_of(out.m, k)));
  out.usual_bend = std::max(kBendLeast, kBendsPerMedian * estimator::median(bends));
  return out;
}

// Of the values that a course of noise sigma is rounded to, which is `off` above the nearest: by
// how much they are above the course in the mean, and their variance.
struct Rounded {
  double mean_off = 0.0, variance = 0.0;
};
Rounded rounded(double off, double sigma) {
  const auto tail = [&](double from) {
    return 0.5 * std::erfc(from / sigma / std::numbers::sqrt2);
  };
  double mean = 0.0, square = 0.0;
  for (double edge = 0.5; edge - 0.5 < kTails * sigma; edge += 1.0) {
    const double above = tail(edge - off), below = tail(edge + off);
    mean += above - below;
    square += 2.0 * edge * (above + below);
  }
  return {mean - off, square - mean * mean};
}

double moved(const std::vector<double>& from, const std::vector<double>& to) {
  double out = 0.0;
  for (std::size_t k = 0; k < to.size(); ++k) out = std::max(out, std::abs(to[k] - from[k]));
  return out;
}

}  // namespace

Channel unrounded(const Channel& channel, double step) {
  constexpr std::size_t kNodesLeast = 4;
  const Nodes nodes(channel);
  if (nodes.count() < kNodesLeast) return channel;
  const std::vector<Group> groups = groups_of(channel, nodes, step);
  Course course = smooth(groups, nodes.count());
  for (int pass = 0; pass < kPasses; ++pass) {
    const bool normal_bends = pass < kPassesSmooth;
    Course next = improved(course, groups, normal_bends);
    const bool is_settled = !normal_bends && moved(course.m, next.m) < kSettled;
    course = std::move(next);
    if (is_settled) break;
  }
  Channel out = channel;
  for (std::size_t i = 0; i < channel.value.size(); ++i) {
    const double value = channel.value[i] / step;
    const double here = at(course.m, nodes.of(channel.t_s[i]));
    const double nearest = value + std::round(here - value);
    const Rounded all = rounded(here - nearest, course.sigma);
    const double noise = value - here - all.mean_off;
    const double larger = std::max(std::sqrt(all.variance), course.sigma);
    out.value[i] = step * (here + noise * course.sigma / larger);
  }
  return out;
}

}  // namespace beltgrip::diagnose
