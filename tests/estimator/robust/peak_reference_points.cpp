#include "tests/estimator/robust/peak_reference_points.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "estimator/robust/thresholds.h"

namespace beltgrip::test {

namespace {
using estimator::Cell;
using estimator::ExperimentRecord;
using estimator::History;
using estimator::Line;
namespace number = estimator;

constexpr std::size_t kOfALevel = 64, kFewestPieces = 8, kTail = 4, kAtEdge = 2;
constexpr double kRounding = 1e-9;  // of sums that are compared

double square(double x) { return x * x; }

struct Piece {  // of the record
  Cell cell;
  double length_s = 0.0;
  double begin_s() const { return cell.t_s - 0.5 * length_s; }
};

// The oldest first. Of each level the newest cells that none of a finer one overlaps.
std::vector<Piece> pieces_of(const History& history) {
  std::vector<Piece> out;
  for (std::size_t level = 0; level < History::kLevels; ++level) {
    const double length_s = history.cell_s(level);
    std::size_t taken = 0;
    for (std::size_t age = 0; age < history.size(level); ++age) {
      const Piece piece{history.cell(level, age), length_s};
      const double end_s = piece.begin_s() + length_s;
      if (!out.empty() && end_s > out.back().begin_s() + 1e-6) continue;
      if (++taken > kOfALevel) break;
      out.push_back(piece);
    }
  }
  std::reverse(out.begin(), out.end());
  return out;
}

struct Mean {
  double time_s = 0.0, value = 0.0;
};
template <class What>
Mean mean_of(const std::vector<Piece>& pieces, std::size_t begin, std::size_t end, What what) {
  Mean out;
  for (std::size_t i = begin; i < end; ++i) {
    out.time_s += pieces[i].length_s;
    out.value += pieces[i].length_s * what(pieces[i].cell);
  }
  out.value /= out.time_s;
  return out;
}

double slip_of(const Cell& cell) { return cell.slip_percent; }

// A point is long enough for its slip to have moved since the one before, or it is long.
bool ends(const ExperimentRecord& record, const std::vector<Piece>& pieces, std::size_t begin,
          std::size_t end, double last_percent) {
  const double noise = record.slip_noise_percent2_s();
  const Mean all = mean_of(pieces, begin, end, slip_of);
  if (all.time_s < number::kPointShortest_s - kRounding) return false;
  if (all.time_s > number::kPointLongest_s) return true;
  const double moved = std::abs(all.value - last_percent);
  if (moved > number::kPointSlip_percent && moved > 2.0 * std::sqrt(noise / all.time_s))
    return true;
  // Or its newest cells have moved from those before.
  if (end - begin <= kTail) return false;
  const Mean tail = mean_of(pieces, end - kTail, end, slip_of);
  const Mean head = mean_of(pieces, begin, end - kTail, slip_of);
  if (head.time_s < 0.5 * number::kPointShortest_s - kRounding) return false;
  const double drift = std::abs(tail.value - head.value);
  return drift > number::kPointSlip_percent &&
         drift > number::kEvident * std::sqrt(noise / tail.time_s + noise / head.time_s);
}

ReferencePoint point_of(const ExperimentRecord& record, double c, double J,
                        const std::vector<Piece>& pieces, std::size_t begin, std::size_t end) {
  ReferencePoint out;
  const auto mean = [&](const auto& what) { return mean_of(pieces, begin, end, what).value; };
  out.duration_s = mean_of(pieces, begin, end, slip_of).time_s;
  out.t_s = mean([](const Cell& cell) { return cell.t_s; });
  out.slip_percent = mean(slip_of);
  out.force_N = mean([&](const Cell& cell) { return record.clamp_force_N(cell); });
  const double readings = mean([](const Cell& cell) { return cell.torque_Nm; });
  const double noise = record.torque_noise_Nm2_s() / out.duration_s;
  out.torque_Nm = readings;
  out.torque_variance = noise;
  double speeds = 0.0;
  if (J > 0.0) {
    const Line& line = record.torque_line();
    const double variation = std::max(0.0, record.torque().density(1.0) / out.duration_s - noise);
    if (out.t_s > line.begin_s + kRounding) {
      out.held_share = noise / (noise + variation);
      out.torque_Nm = out.held_share * line.at(out.t_s) + (1.0 - out.held_share) * readings;
      out.torque_variance =
          square(out.held_share) * variation + square(1.0 - out.held_share) * noise;
    }
    // J domega/dt, from the cells to both sides of either end.
    double t_s[2], speed[2];
    const std::size_t edges[2] = {begin, end};
    for (int k = 0; k < 2; ++k) {
      const std::size_t from = edges[k] > kAtEdge ? edges[k] - kAtEdge : 0;
      const std::size_t to = std::min(pieces.size(), edges[k] + kAtEdge);
      const Mean time = mean_of(pieces, from, to, [](const Cell& cell) { return cell.t_s; });
      t_s[k] = time.value;
      speed[k] =
          mean_of(pieces, from, to, [](const Cell& cell) { return cell.omega_p_rad_s; }).value;
      out.speed_variance[k] = record.omega_noise_rad2_s() / time.time_s;
    }
    const double per_s = J / std::max(1e-3, t_s[1] - t_s[0]);
    out.torque_Nm -= per_s * (speed[1] - speed[0]);
    speeds = square(per_s) * (out.speed_variance[0] + out.speed_variance[1]);
  }
  out.mu = c * out.torque_Nm / out.force_N;
  out.variance = std::max(1e-12, square(c / out.force_N) * (out.torque_variance + speeds));
  if (out.t_s < record.force_line().begin_s - kRounding) {
    out.force_variance =
        square(out.mu / out.force_N) * record.force().density(out.duration_s) / out.duration_s;
  }
  return out;
}

}  // namespace

std::vector<ReferencePoint> reference_points(const ExperimentRecord& record,
                                             double traction_per_Nm_N, double inertia_kg_m2) {
  std::vector<ReferencePoint> out;
  const std::vector<Piece> pieces = pieces_of(record.history());
  if (pieces.size() < kFewestPieces || !record.force_line().valid) return out;
  double last_percent = pieces.front().cell.slip_percent;
  for (std::size_t begin = 0; begin < pieces.size();) {
    std::size_t end = begin + 1;
    while (end < pieces.size() && !ends(record, pieces, begin, end, last_percent)) ++end;
    out.push_back(point_of(record, traction_per_Nm_N, inertia_kg_m2, pieces, begin, end));
    last_percent = out.back().slip_percent;
    begin = end;
  }
  return out;
}

}  // namespace beltgrip::test
