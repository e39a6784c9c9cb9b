#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "tools/diagnose/infer/cells.h"

namespace beltgrip::diagnose {
namespace {

constexpr std::array kLengths{0.12, 0.3, 0.8};    // of the abscissa
constexpr std::array kSizes{0.1, 0.3, 1.0, 2.0};  // in units of the row
constexpr int kPlaces = 20;
constexpr std::array kWidths{0.05, 0.1, 0.2, 0.35};
constexpr double kJitter = 1e-6;

double place_of(int knot) { return static_cast<double>(knot) / (kCellKnots - 1); }

// Lower roots of the covariances of smooth functions, by length.
const std::array<KnotSquare, kLengths.size()>& smooth_roots() {
  static const auto kRoots = [] {
    std::array<KnotSquare, kLengths.size()> out;
    for (std::size_t l = 0; l < out.size(); ++l) {
      KnotSquare k;
      for (int i = 0; i < kCellKnots; ++i) {
        for (int j = 0; j < kCellKnots; ++j) {
          const double apart = (place_of(i) - place_of(j)) / kLengths[l];
          k(i, j) = std::exp(-0.5 * apart * apart) + (i == j ? kJitter : 0.0);
        }
      }
      out[l] = k.llt().matrixL();
    }
    return out;
  }();
  return kRoots;
}

// Shapes of one family, each of size one.
using Family = std::vector<KnotVector>;
KnotVector shape(auto&& value) {
  KnotVector out;
  for (int i = 0; i < kCellKnots; ++i) out[i] = value(place_of(i));
  return out;
}
const std::vector<Family>& families() {
  static const std::vector<Family> kFamilies = [] {
    Family step, kink, bump;
    for (int i = 0; i < kPlaces; ++i) {
      const double at = (i + 0.5) / kPlaces;
      step.push_back(shape([&](double x) { return x > at ? 1.0 : 0.0; }));
      kink.push_back(shape([&](double x) { return std::max(0.0, x - at) / (1.0 - at); }));
      kink.push_back(shape([&](double x) { return std::max(0.0, at - x) / at; }));
      for (const double width : kWidths) {
        bump.push_back(shape([&](double x) {
          const double apart = (x - at) / width;
          return std::exp(-0.5 * apart * apart);
        }));
      }
    }
    return std::vector<Family>{step, kink, bump};
  }();
  return kFamilies;
}

// One assumption on the function: its log evidence over none, and its posterior.
struct Part {
  double log_evidence = 0.0;  // with the scatter's own likelihood
  double log_prior = 0.0;     // of the assumption
  KnotVector mean = KnotVector::Zero();
};
struct Smooth : Part {
  KnotSquare covariance = KnotSquare::Zero();
};
struct Law : Part {
  KnotVector lever = KnotVector::Zero();  // covariance = lever lever'
};
struct Parts {
  std::vector<Smooth> smooth;
  std::vector<Law> laws;
};

double ln_sum(const std::vector<double>& values) {
  const double top = *std::max_element(values.begin(), values.end());
  double sum = 0.0;
  for (const double each : values) sum += std::exp(each - top);
  return top + std::log(sum);
}

void add_smooth(const CellScore& score, double beyond, std::vector<Smooth>& parts) {
  for (const KnotSquare& root : smooth_roots()) {
    const KnotSquare inner = root.transpose() * score.information * root;
    const KnotVector pulled = root.transpose() * score.score;
    for (const double size : kSizes) {
      const Eigen::LLT<KnotSquare> llt(KnotSquare::Identity() + size * size * inner);
      const KnotVector solved = llt.solve(pulled);
      Smooth part;
      part.log_evidence = beyond + 0.5 * size * size * pulled.dot(solved) -
                          llt.matrixLLT().diagonal().array().log().sum();
      part.mean = size * size * (root * solved);
      part.covariance = size * size * (root * llt.solve(root.transpose()));
      parts.push_back(std::move(part));
    }
  }
}

// Returns the log evidence of each family: the mean over its shapes, at the best size.
std::vector<double> add_laws(const CellScore& score, double beyond, std::vector<Law>& parts) {
  std::vector<double> out;
  for (const Family& family : families()) {
    std::vector<double> information, pull;
    for (const KnotVector& v : family) {
      information.push_back(v.dot(score.information * v));
      pull.push_back(v.dot(score.score));
    }
    double best = -std::numeric_limits<double>::infinity();
    for (const double size : kSizes) {
      std::vector<double> evidence;
      for (std::size_t i = 0; i < family.size(); ++i) {
        const double precision = information[i] + 1.0 / (size * size);
        evidence.push_back(beyond + 0.5 * pull[i] * pull[i] / precision -
                           0.5 * std::log(size * size * precision));
        Law part;
        part.log_evidence = evidence.back();
        part.log_prior = -std::log(static_cast<double>(family.size()));
        part.mean = pull[i] / precision * family[i];
        part.lever = family[i] / std::sqrt(precision);
        parts.push_back(std::move(part));
      }
      best = std::max(best, ln_sum(evidence) - std::log(static_cast<double>(family.size())));
    }
    out.push_back(best);
  }
  return out;
}

// Of a function over none: smooth ones and laws alike, the scatter averaged over on both sides.
double averaged(const Parts& parts, const std::vector<CellScore>& scores, double none) {
  std::vector<double> smooth, laws, without;
  for (const Smooth& part : parts.smooth) smooth.push_back(part.log_evidence);
  for (const Law& part : parts.laws) laws.push_back(part.log_evidence + part.log_prior);
  for (const CellScore& each : scores) without.push_back(each.log_likelihood - none);
  const auto n = static_cast<double>(scores.size());
  const double of_laws = static_cast<double>(families().size() * kSizes.size()) * n;
  return ln_sum({ln_sum(smooth) - std::log(static_cast<double>(smooth.size())),
                 ln_sum(laws) - std::log(of_laws)}) -
         std::log(2.0) - ln_sum(without) + std::log(n);
}

void mix(const Parts& parts, Cell& cell) {
  constexpr double kNegligible = -12.0;  // ln of a weight
  double top = -std::numeric_limits<double>::infinity();
  const auto ln_of = [](const Part& part) { return part.log_evidence + part.log_prior; };
  for (const Part& part : parts.smooth) top = std::max(top, ln_of(part));
  for (const Part& part : parts.laws) top = std::max(top, ln_of(part));
  double sum = 0.0;
  cell.mean.setZero();
  KnotSquare square = KnotSquare::Zero();
  // Returns the weight of the part, 0 where it is negligible.
  const auto add = [&](const Part& part) {
    const double ln_weight = ln_of(part) - top;
    if (ln_weight < kNegligible) return 0.0;
    const double weight = std::exp(ln_weight);
    sum += weight;
    cell.mean += weight * part.mean;
    square += weight * part.mean * part.mean.transpose();
    return weight;
  };
  for (const Smooth& part : parts.smooth) {
    if (const double weight = add(part); weight > 0.0) square += weight * part.covariance;
  }
  for (const Law& part : parts.laws) {
    if (const double weight = add(part); weight > 0.0) {
      square += weight * part.lever * part.lever.transpose();
    }
  }
  cell.mean /= sum;
  cell.covariance = square / sum - cell.mean * cell.mean.transpose();
}

}  // namespace

void judge_cell(Cell& cell) {
  double none = -std::numeric_limits<double>::infinity();
  for (const CellScore& each : cell.scores) none = std::max(none, each.log_likelihood);
  Parts parts;
  double law = -std::numeric_limits<double>::infinity(), smooth = law;
  for (const CellScore& each : cell.scores) {
    const double beyond = each.log_likelihood - none;
    add_smooth(each, beyond, parts.smooth);
    for (const double family : add_laws(each, beyond, parts.laws)) law = std::max(law, family);
  }
  for (const Smooth& part : parts.smooth) smooth = std::max(smooth, part.log_evidence);
  cell.smooth_gain = 2.0 * smooth;
  cell.law_gain = 2.0 * law;
  cell.log_evidence = averaged(parts, cell.scores, none);
  mix(parts, cell);
  const CellScore& fitted = cell.scores.front();
  const double taken =
      2.0 * cell.mean.dot(fitted.score) - cell.mean.dot(fitted.information * cell.mean);
  cell.share = fitted.misfit > 0.0 ? std::clamp(taken / fitted.misfit, 0.0, 1.0) : 0.0;
}

}  // namespace beltgrip::diagnose
