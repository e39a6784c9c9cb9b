#include "tools/monitor/plot.h"

#include <algorithm>
#include <cmath>

#include "can_dbc/text/format.h"

namespace beltgrip::monitor {

namespace {

constexpr int kMargin = 7;  // columns of the numbers at the left, with the axis
constexpr int kLeastColumns = 20, kLeastRows = 5;
constexpr double kHeadroom = 1.05;
constexpr double kLeastSigma_percent = 0.5;  // so that noise at rest is no curve
constexpr double kLeastMu = 0.02;

// The part of the plot between the axes.
struct Field {
  int columns, rows;
  double sigma_most, mu_most;
  std::vector<std::string> cells;

  Field(int width, int height, double sigma, double mu)
      : columns(width),
        rows(height),
        sigma_most(sigma),
        mu_most(mu),
        cells(static_cast<std::size_t>(height), std::string(static_cast<std::size_t>(width), ' ')) {
  }
  int row_of(double mu) const {
    return static_cast<int>(std::lround((1.0 - mu / mu_most) * (rows - 1)));
  }
  int column_of(double sigma) const {
    return static_cast<int>(std::lround(sigma / sigma_most * (columns - 1)));
  }
  void put(int column, int row, char mark) {
    if (column < 0 || column >= columns || row < 0 || row >= rows) return;
    cells[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)] = mark;
  }
  void across(double mu, char mark) {
    for (int column = 0; column < columns; ++column) put(column, row_of(mu), mark);
  }
};

// Magnitudes: the sign is the direction's.
Field field_of(const std::vector<CurvePoint>& points, const Friction& friction, int columns,
               int rows) {
  double sigma = kLeastSigma_percent, mu = kLeastMu;
  for (const CurvePoint& each : points) {
    sigma = std::max(sigma, each.sigma_star_percent);
    mu = std::max(mu, each.mu_star);
  }
  if (friction.kind == estimator::PeakKind::kValue) mu = std::max(mu, friction.high());
  if (friction.kind == estimator::PeakKind::kLowerBound) mu = std::max(mu, friction.mu_max);
  return {columns, rows, sigma * kHeadroom, mu * kHeadroom};
}

void draw(Field& field, const std::vector<CurvePoint>& points, const Friction& friction) {
  if (friction.kind == estimator::PeakKind::kValue) {
    field.across(friction.low(), ':');
    field.across(friction.high(), ':');
    field.across(friction.mu_max, '-');
  } else if (friction.kind == estimator::PeakKind::kLowerBound) {
    field.across(friction.mu_max, '_');
  }
  for (std::size_t phase = 0; phase < kPhaseMarks; ++phase) {
    for (const CurvePoint& each : points) {
      if (static_cast<std::size_t>(each.phase) != phase) continue;
      field.put(field.column_of(each.sigma_star_percent), field.row_of(each.mu_star),
                kPhaseMark[phase]);
    }
  }
}

}  // namespace

std::vector<std::string> plot(const std::vector<CurvePoint>& points, const Friction& friction,
                              int columns, int rows) {
  const auto count = static_cast<std::size_t>(std::max(rows, 0));
  std::vector<std::string> lines(count);
  const bool empty = points.empty() && friction.kind == estimator::PeakKind::kNone;
  if (empty || columns < kLeastColumns || rows < kLeastRows) return lines;
  Field field = field_of(points, friction, columns - kMargin, rows - 1);
  draw(field, points, friction);
  for (int row = 0; row < field.rows; ++row) {
    std::string number(kMargin - 1, ' ');
    const bool top = row == 0;
    const bool bottom = row == field.rows - 1;
    if (top) number = format("%6.3f", field.mu_most);
    if (bottom) number = format("%6.3f", 0.0);
    if (row == field.rows / 2) number = "   mu*";
    lines[static_cast<std::size_t>(row)] =
        number + "|" + field.cells[static_cast<std::size_t>(row)];
  }
  const std::string most = format("%.1f %%", field.sigma_most);
  std::string axis = std::string(kMargin - 1, ' ') + "0 slip sigma*";
  const int gap = columns - static_cast<int>(axis.size() + most.size());
  if (gap > 0) axis += std::string(static_cast<std::size_t>(gap), ' ') + most;
  lines.back() = axis.substr(0, static_cast<std::size_t>(columns));
  return lines;
}

}  // namespace beltgrip::monitor
