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
// ramps, waves, corners and holds, with noise of 0.08 and 0.2 at 50 and 200 Hz, moves by less than
// a sixth with each number here a fifth less or a quarter more, but with kNode_s less, which leaves
// 21 % more of corners.
constexpr double kNode_s = 0.1;  // as far apart as the samples of an experiment
constexpr double kBendAtFirst = 0.01;
// Of a course that is straight but for its corners. Chosen: at 0.002 a slow ramp waves between its
// steps (4.5 kPa of 40, at 0.0005 2.2, at 0.0001 1.8). Of 16 campaigns of other make a fifth more
// lets one alarm again, a fifth less none.
constexpr double kBendLeast = 0.0005;
constexpr double kDegrees = 5.0;         // of Student's t: few bends are corners
constexpr double kBendsPerMedian = 1.5;  // derived: half of those of 5 degrees are below 0.73
constexpr int kPasses = 20, kPassesSmooth = 5;
constexpr double kSettled = 1e-3;
// Of a sample: where it says nothing of where the course is, that stays.
constexpr double kToldLeast = 1e-3, kStays = 1e-6;
constexpr double kJumpSteps = 3.0;  // from a sample to the next
// Of the search for the noise: a step of it, as a factor, and a share of one that ends it.
constexpr double kNoiseAtFirst = 0.2;
constexpr double kNoiseLeast = 0.05, kNoiseMost = 1.0;  // beyond, no sample tells it
constexpr double kNoiseStep = 1.2, kNoiseSettled = 0.05;
constexpr double kStray = 0.02, kStrayDensity = 0.1;  // one sample in fifty, anywhere in ten steps
// What bends by so many usual ones is a corner; of no use are so many nodes on either side.
constexpr double kCornerBends = 3.0;
constexpr std::size_t kCornerNodes = 2;
// A hold lasts so many times as long as what it is entered and left by takes to pass a step.
// Derived: where a wave turns it is on one step for up to 4.8 times as long; a ramp begins and ends
// on one for once as long at most.
// kHeldTimesAtEnd a fifth less: one of eleven healthy campaigns of other make alarms; a fifth more,
// and kStays either way: the same.
constexpr double kHeldTimes = 3.0, kHeldTimesAtTurn = 6.0, kHeldTimesAtEnd = 1.5;
constexpr double kHeldSlope = 1e-3;  // from a node to the next
// Of the middle of its step, information: less than that of a dozen samples which noise takes over
// its edge, and more than that of the corners at its ends.
constexpr double kHeldMiddle = 100.0;
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
  // No course from node to node follows a jump.
  std::vector<bool> jumps(nodes.count(), false);
  for (std::size_t i = 1; i < channel.value.size(); ++i) {
    if (std::abs(channel.value[i] - channel.value[i - 1]) < kJumpSteps * step) continue;
    jumps[nodes.of(channel.t_s[i]).node] = jumps[nodes.of(channel.t_s[i - 1]).node] = true;
  }
  std::vector<Group> out;
  for (std::size_t i = 0; i < channel.value.size(); ++i) {
    const Place place = nodes.of(channel.t_s[i]);
    if (jumps[place.node]) continue;
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

  // Where no sample says anything, as where a channel jumps all the time.
  void stay(std::size_t k, double at) {
    diagonal[k] += kStays;
    right[k] += kStays * at;
  }
  void add_slope(std::size_t k, double weight) {
    diagonal[k] += weight;
    diagonal[k + 1] += weight;
    beside[k] -= weight;
  }

  std::vector<double> solve() && {
    factor();
    const std::size_t n = diagonal.size();
    std::vector<double> out(n);
    for (std::size_t i = n; i-- > 0;) {
      out[i] = right[i] / diagonal[i];
      if (i + 1 < n) out[i] -= beside[i] * out[i + 1];
      if (i + 2 < n) out[i] -= second[i] * out[i + 2];
    }
    return out;
  }
  double ln_determinant() && {
    factor();
    double sum = 0.0;
    for (const double each : diagonal) sum += std::log(each);
    return sum;
  }

 private:
  void factor() {
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
  }
};

// Of the noise within the interval that a value says.
Within noise_of(double value, double here, double sigma) {
  return within((value - 0.5 - here) / sigma, (value + 0.5 - here) / sigma);
}

double bend_of(const std::vector<double>& m, std::size_t k) {
  return m[k - 1] - 2.0 * m[k] + m[k + 1];
}

// The course stays on one value, from node to node.
struct Hold {
  std::size_t begin, end;
  double value;  // that is read there
};

struct Course {
  std::vector<double> m;  // at the nodes
  double sigma = 0.0;     // of the noise
  double usual_bend = kBendAtFirst;
  std::vector<Hold> holds;
};

// As if rounding were noise, and bends were normal. middle: of the channel.
Course smooth(const std::vector<Group>& groups, std::size_t nodes, double sigma, double middle) {
  Course out;
  out.sigma = sigma;
  Banded equations(nodes);
  for (std::size_t k = 0; k < nodes; ++k) equations.stay(k, middle);
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

// Information on the course.
double told_by(const Group& group, const Within& noise, double sigma) {
  return group.count * std::max((1.0 - noise.variance) / (sigma * sigma), kToldLeast);
}

// A few samples are of no noise: the course has gone round a corner there, or they are far off.
double ln_likelihood(double value, double here, double sigma) {
  const double off = value - here;
  const double scale = 1.0 / (sigma * std::numbers::sqrt2);
  const double share = 0.5 * (std::erfc((off - 0.5) * scale) - std::erfc((off + 0.5) * scale));
  return std::log((1.0 - kStray) * share + kStray * kStrayDensity);
}

// Of a step towards what is most probable, at a course.
Banded equations_at(const Course& from, const std::vector<Group>& groups, bool normal_bends) {
  const std::size_t nodes = from.m.size();
  Banded out(nodes);
  for (std::size_t k = 0; k < nodes; ++k) out.stay(k, from.m[k]);
  for (const Group& group : groups) {
    const double here = at(from.m, group.place);
    const Within noise = noise_of(group.value, here, from.sigma);
    const double told = told_by(group, noise, from.sigma);
    out.add(group.place, told);
    out.pull(group.place, told * here + group.count * noise.mean / from.sigma);
  }
  for (std::size_t k = 1; k + 1 < nodes; ++k) {
    const double bend = bend_of(from.m, k) / from.usual_bend;
    const double weight = normal_bends ? 1.0 : (kDegrees + 1.0) / (kDegrees + bend * bend);
    out.add_bend(k, weight / (from.usual_bend * from.usual_bend));
  }
  for (const Hold& hold : from.holds) {
    const double told = kHeldMiddle / static_cast<double>(hold.end - hold.begin);
    for (std::size_t k = hold.begin; k < hold.end; ++k) {
      const Place place{std::min(k, nodes - 2), k < nodes - 1 ? 0.0 : 1.0};
      out.add(place, told);
      out.pull(place, told * hold.value);
      if (k + 1 < hold.end) out.add_slope(k, 1.0 / (kHeldSlope * kHeldSlope));
    }
  }
  return out;
}

// One step of Newton's; the usual bend from what it leaves. With normal bends there is one such
// course and no other.
Course improved(const Course& from, const std::vector<Group>& groups, bool normal_bends) {
  Course out = from;
  out.m = equations_at(from, groups, normal_bends).solve();
  if (normal_bends) return out;
  std::vector<double> bends;
  for (std::size_t k = 1; k + 1 < out.m.size(); ++k) bends.push_back(std::abs(bend_of(out.m, k)));
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
  return {mean - off, std::max(square - mean * mean, 0.0)};
}

double middle_of(const Channel& channel) {
  std::vector<double> values = channel.value;
  return estimator::median(values);
}

double moved(const std::vector<double>& from, const std::vector<double>& to) {
  double out = 0.0;
  for (std::size_t k = 0; k < to.size(); ++k) out = std::max(out, std::abs(to[k] - from[k]));
  return out;
}

// A channel on its way to its course.
class Search {
 public:
  Search(const Channel& channel, double step, double sigma)
      : nodes_(channel),
        groups_(groups_of(channel, nodes_, step)),
        course_(smooth(groups_, nodes_.count(), sigma, middle_of(channel) / step)),
        phase_(std::remainder(channel.value.front() / step, 1.0)) {}
  static bool is_possible(const Channel& channel) {
    constexpr std::size_t kNodesLeast = 4;
    return !channel.empty() && Nodes(channel).count() >= kNodesLeast;
  }

  // By how much the course has moved.
  double pass(bool normal_bends) {
    Course next = improved(course_, groups_, normal_bends);
    const double by = moved(course_.m, next.m);
    course_ = std::move(next);
    return by;
  }
  void set_noise(double sigma) { course_.sigma = sigma; }
  // Of the samples but those about corners, were the noise this, whatever the course (Laplace).
  double log_likelihood(double sigma) const {
    Course there = course_;
    there.sigma = sigma;
    double sum = -0.5 * equations_at(there, groups_, false).ln_determinant();
    for (const Group& group : groups_) {
      if (is_corner(group.place.node)) continue;
      sum += group.count * ln_likelihood(group.value, at(course_.m, group.place), sigma);
    }
    return sum;
  }
  // Where the course stays on one step for much longer than it takes to pass those beside it, it
  // has been held. Between two crossings the samples say nothing of it, and it would go there from
  // what is before the hold to what is behind.
  void hold_where_held() {
    const std::vector<Dwell> all = dwells();
    course_.holds.clear();
    for (std::size_t i = 0; i < all.size(); ++i) {
      const std::size_t before = i > 0 ? all[i - 1].size() : 0;
      const std::size_t after = i + 1 < all.size() ? all[i + 1].size() : 0;
      const bool is_end = before == 0 || after == 0;
      const bool turns = !is_end && all[i - 1].on == all[i + 1].on;
      const double times = is_end ? kHeldTimesAtEnd : turns ? kHeldTimesAtTurn : kHeldTimes;
      const auto passing = static_cast<double>(std::max({before, after, std::size_t{1}}));
      if (static_cast<double>(all[i].size()) < times * passing) continue;
      course_.holds.push_back(
          {all[i].begin + before, all[i].end - after, static_cast<double>(all[i].on) + phase_});
    }
  }
  double course_at(double t_s) const { return at(course_.m, nodes_.of(t_s)); }

 private:
  // Nodes on one value.
  struct Dwell {
    std::size_t begin, end;
    long on;
    std::size_t size() const { return end - begin; }
  };
  // A course that swings about an edge goes across and back, for no longer than it was on either
  // side: it dwells there, and has not passed the other value.
  std::vector<Dwell> dwells() const {
    std::vector<Dwell> out;
    const std::vector<double>& m = course_.m;
    for (std::size_t k = 0; k <= m.size(); ++k) {
      const bool is_end = k == m.size();
      const long on = is_end ? 0 : std::lround(m[k] - phase_);
      if (!is_end && !out.empty() && out.back().on == on) {
        out.back().end = k + 1;
        continue;
      }
      while (out.size() > 2 && goes_back(out.end()[-3], out.end()[-2], out.end()[-1])) {
        out.end()[-3].end = out.back().end;
        out.resize(out.size() - 2);
      }
      if (!is_end) out.push_back({k, k + 1, on});
    }
    return out;
  }
  static bool goes_back(const Dwell& before, const Dwell& there, const Dwell& after) {
    return before.on == after.on && there.size() <= std::min(before.size(), after.size());
  }
  // About a node: the course bends there as it does not elsewhere.
  bool is_corner(std::size_t node) const {
    const std::size_t last = std::min(course_.m.size() - 2, node + kCornerNodes + 1);
    for (std::size_t k = node > kCornerNodes ? node - kCornerNodes : 1; k <= last; ++k) {
      if (std::abs(bend_of(course_.m, k)) > kCornerBends * course_.usual_bend) return true;
    }
    return false;
  }

  Nodes nodes_;
  std::vector<Group> groups_;
  Course course_;
  double phase_;  // of the values that are read, as those of a channel with an offset
};

// Where a parabola through three values has its top, in steps from the middle one; at most one.
double top_of(double before, double here, double after) {
  if (before >= here || after >= here) return after > before ? 1.0 : -1.0;
  return std::clamp(0.5 * (after - before) / (2.0 * here - before - after), -1.0, 1.0);
}

}  // namespace

double noise_before_rounding(std::span<const Channel* const> channels, double step) {
  std::vector<Search> all;
  for (const Channel* channel : channels) {
    if (Search::is_possible(*channel)) all.emplace_back(*channel, step, kNoiseAtFirst);
  }
  double sigma = kNoiseAtFirst;
  for (int pass = 0; pass < kPasses; ++pass) {
    for (Search& each : all) each.pass(pass < kPassesSmooth);
    if (pass < kPassesSmooth) continue;
    const auto likely = [&](double noise) {
      double sum = 0.0;
      for (const Search& each : all) sum += each.log_likelihood(noise);
      return sum;
    };
    const double by = top_of(likely(sigma / kNoiseStep), likely(sigma), likely(sigma * kNoiseStep));
    sigma = std::clamp(sigma * std::pow(kNoiseStep, by), kNoiseLeast, kNoiseMost);
    for (Search& each : all) each.set_noise(sigma);
    if (std::abs(by) < kNoiseSettled) break;
  }
  return sigma;
}

Channel unrounded(const Channel& channel, double step, double noise) {
  if (!Search::is_possible(channel)) return channel;
  Search search(channel, step, noise);
  const auto settle = [&](int first) {
    for (int pass = first; pass < kPasses; ++pass) {
      const bool normal_bends = pass < kPassesSmooth;
      if (search.pass(normal_bends) < kSettled && !normal_bends) break;
    }
  };
  settle(0);
  search.hold_where_held();
  settle(kPassesSmooth);
  Channel out = channel;
  for (std::size_t i = 0; i < channel.value.size(); ++i) {
    const double value = channel.value[i] / step;
    const double here = search.course_at(channel.t_s[i]);
    const double nearest = value + std::round(here - value);
    const Rounded all = rounded(here - nearest, noise);
    const double left = value - here - all.mean_off;
    const double larger = std::max(std::sqrt(all.variance), noise);
    out.value[i] = step * (here + left * noise / larger);
  }
  return out;
}

}  // namespace beltgrip::diagnose
