#include "tools/diagnose/infer/laws.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

namespace beltgrip::diagnose {
namespace {

constexpr std::array kSizes{0.3, 1.0, 3.0, 10.0};  // in units of the row, over the whole range
constexpr int kPlaces = 20;
constexpr std::array kWidths{0.05, 0.1, 0.2, 0.35};
constexpr double kFarFromZero = 0.05;  // of the highest value: a logarithm or an inverse is defined

// value: of a shape at u, 0 to 1 over the range, with its place and width.
struct Family {
  std::string_view name, text;  // %1: the size, %2: the place, %3: the width
  double (*value)(double u, double place, double width);
  int places;  // 0: none
  int widths;
  bool of_value;  // of the variable itself, not of u
};

double ramp(double x) { return std::max(0.0, x); }

constexpr std::array kFamilies{
    Family{"linear", "%1 over the range, a straight line",
           [](double u, double, double) { return u; }, 0, 0, false},
    Family{"logarithm", "%1 over the range, by the logarithm",
           [](double x, double, double) { return std::log(x); }, 0, 0, true},
    Family{"inverse", "%1 over the range, by the inverse",
           [](double x, double, double) { return 1.0 / x; }, 0, 0, true},
    Family{"root", "%1 over the range, by the square root",
           [](double x, double, double) { return std::sqrt(x); }, 0, 0, true},
    Family{"square", "%1 to the far end, by the square about %2",
           [](double u, double at, double) { return (u - at) * (u - at); }, kPlaces, 0, false},
    Family{"exponential", "%1 over the range, exponential",
           [](double u, double at, double) {
             return std::exp((at < 0.5 ? -2.0 : 2.0) * u / (0.1 + std::abs(at - 0.5)));
           },
           6, 0, false},
    Family{"kink", "flat up to %2, then %1 to the end",
           [](double u, double at, double) { return ramp(u - at); }, kPlaces, 0, false},
    Family{"kink from below", "%1 at the beginning, flat from %2 on",
           [](double u, double at, double) { return ramp(at - u); }, kPlaces, 0, false},
    Family{"step", "a step of %1 at %2",
           [](double u, double at, double) { return u > at ? 1.0 : 0.0; }, kPlaces, 0, false},
    Family{"sigmoid", "a rise by %1 about %2, over %3",
           [](double u, double at, double w) { return 1.0 / (1.0 + std::exp((at - u) / w)); },
           kPlaces, 2, false},
    Family{"Gauss", "a bump of %1 at %2, width %3",
           [](double u, double at, double w) {
             return std::exp(-0.5 * (u - at) * (u - at) / (w * w));
           },
           kPlaces, 4, false},
    Family{
        "Lorentz", "a bump of %1 at %2, width %3, with wide feet",
        [](double u, double at, double w) { return 1.0 / (1.0 + (u - at) * (u - at) / (w * w)); },
        kPlaces, 4, false},
};

struct Shape {
  double place = 0.0, width = 0.0;
  KnotVector value;  // from 0 to 1, or 1 to 0
};

std::vector<Shape> shapes_of(const Family& family, const Abscissa& abscissa) {
  std::vector<Shape> out;
  for (int p = 0; p < std::max(1, family.places); ++p) {
    for (int w = 0; w < std::max(1, family.widths); ++w) {
      Shape shape;
      shape.place = family.places > 0 ? (p + 0.5) / family.places : 0.0;
      shape.width = family.widths > 0 ? kWidths[static_cast<std::size_t>(w)] : 0.0;
      for (int i = 0; i < kCellKnots; ++i) {
        const double u = static_cast<double>(i) / (kCellKnots - 1);
        const double x = family.of_value ? std::lerp(abscissa.low, abscissa.high, u) : u;
        shape.value[i] = family.value(x, shape.place, shape.width);
      }
      const double low = shape.value.minCoeff(), span = shape.value.maxCoeff() - low;
      if (!(span > 0.0)) continue;
      shape.value = ((shape.value.array() - low) / span).matrix();
      out.push_back(shape);
    }
  }
  return out;
}

std::string number(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.3g", value);
  return buffer;
}

struct Told {
  double value;
  std::string_view unit;
};
std::string filled(std::string_view text, Told size, Told place, Told width) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      out += text[i];
      continue;
    }
    const char which = text[++i];
    const auto& [value, unit] = which == '1' ? size : which == '2' ? place : width;
    out += number(value);
    if (!unit.empty()) out.append(" ").append(unit);
  }
  return out;
}

// A law and a constant, of which nothing is known, beside it.
struct Fitted {
  double log_evidence = 0.0, size = 0.0;
};
Fitted fit(const CellScore& score, const KnotVector& shape, double size) {
  Eigen::Matrix<double, kCellKnots, 2> lever;
  lever.col(0) = size * shape;
  lever.col(1).setConstant(kSizes.back());
  const Eigen::Matrix2d inner =
      Eigen::Matrix2d::Identity() + lever.transpose() * score.information * lever;
  const Eigen::Vector2d pull = lever.transpose() * score.score;
  const Eigen::LLT<Eigen::Matrix2d> llt(inner);
  const Eigen::Vector2d solved = llt.solve(pull);
  return {0.5 * pull.dot(solved) - llt.matrixLLT().diagonal().array().log().sum(),
          size * solved[0]};
}

LawEvidence judge(const Family& family, const std::vector<CellScore>& scores,
                  const InjectionRow& row, const Abscissa& abscissa) {
  double none = -std::numeric_limits<double>::infinity();
  for (const CellScore& each : scores) none = std::max(none, each.log_likelihood);
  double without = 0.0;
  for (const CellScore& each : scores) without += std::exp(each.log_likelihood - none);
  std::vector<double> evidence;
  double best = -std::numeric_limits<double>::infinity();
  LawEvidence out;
  out.name = family.name;
  for (const Shape& shape : shapes_of(family, abscissa)) {
    for (const CellScore& score : scores) {
      for (const double size : kSizes) {
        const Fitted fitted = fit(score, shape.value, size);
        evidence.push_back(fitted.log_evidence + score.log_likelihood - none);
        if (evidence.back() <= best) continue;
        best = evidence.back();
        const double span = abscissa.high - abscissa.low;
        const std::string_view unit = abscissa.variable ? abscissa.variable->unit : "";
        out.text = filled(family.text, {fitted.size * row.unit * row.told_per_SI, row.told_unit},
                          {abscissa.low + shape.place * span, unit}, {shape.width * span, unit});
      }
    }
  }
  double sum = 0.0;
  for (const double each : evidence) sum += std::exp(each - best);
  out.log_evidence = best + std::log(sum / static_cast<double>(evidence.size())) -
                     std::log(without / static_cast<double>(scores.size()));
  return out;
}

}  // namespace

std::vector<LawEvidence> law_evidences(const std::vector<CellScore>& scores,
                                       const InjectionRow& row, const Abscissa& abscissa) {
  std::vector<LawEvidence> out;
  for (const Family& family : kFamilies) {
    if (family.of_value && !(abscissa.low > kFarFromZero * abscissa.high)) continue;
    out.push_back(judge(family, scores, row, abscissa));
  }
  return out;
}

}  // namespace beltgrip::diagnose
