#include "tools/diagnose/data/order_lines.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <optional>

namespace beltgrip::diagnose {
namespace {

constexpr double kPiece_s = 4.0;
constexpr double kSmooth_s = 0.3;  // half width of the local line that is taken out
constexpr double kLineSpeedMin_rad_s = 20.0;
constexpr int kSamplesMin = 60;            // per piece
constexpr double kSmoothSamplesMin = 8.0;  // chosen: of the local line
constexpr double kPieceMin = 0.8;          // chosen, of kPiece_s
constexpr double kRestMax = 0.1;           // chosen, of the speed: more is no tooth
constexpr double kExcessMax = 50.0;        // chosen: one piece alone does not make a line
// One sigma of what jitter of the clock and unfinished revolutions leave, share of the amplitude.
constexpr double kAmplitudeShare = 3e-3;
// Chosen, of a line: where the local straight line leaves less of it, it leaves the course of the
// speed as well.
constexpr double kLeft = 0.5;
// Neighbouring orders: what noise there is without a line.
constexpr double kNeighbours[] = {0.80, 0.84, 0.88, 0.92, 1.08, 1.12, 1.16, 1.20};

// Samples of the local line on each side of its middle.
double each_side(double period_s) { return std::round(kSmooth_s / period_s); }

// Local straight line through the samples about each; the window ends between two samples.
std::vector<double> smoothed(const Channel& speed, double period_s) {
  const std::size_t n = speed.t_s.size();
  const double reach_s = (each_side(period_s) + 0.5) * period_s;
  std::vector<double> out(n, std::numeric_limits<double>::quiet_NaN());
  std::size_t first = 0, end = 0;
  double s0 = 0.0, s1 = 0.0, s2 = 0.0, y0 = 0.0, y1 = 0.0;
  const double origin_s = n > 0 ? speed.t_s[0] : 0.0;
  const auto change = [&](std::size_t i, double sign) {
    const double t = speed.t_s[i] - origin_s;
    s0 += sign;
    s1 += sign * t;
    s2 += sign * t * t;
    y0 += sign * speed.value[i];
    y1 += sign * t * speed.value[i];
  };
  for (std::size_t i = 0; i < n; ++i) {
    while (end < n && speed.t_s[end] <= speed.t_s[i] + reach_s) change(end++, 1.0);
    while (speed.t_s[first] < speed.t_s[i] - reach_s) change(first++, -1.0);
    const double determinant = s0 * s2 - s1 * s1;
    if (s0 < kSmoothSamplesMin || determinant <= 0.0) continue;
    const double slope = (s0 * y1 - s1 * y0) / determinant;
    out[i] = (y0 - slope * s1) / s0 + slope * (speed.t_s[i] - origin_s);
  }
  return out;
}

}  // namespace

void OrderLine::add(const OrderLine& other) {
  pieces += other.pieces;
  excess += other.excess;
  power += other.power;
  power_squares += other.power_squares;
  noise += other.noise;
  folded += other.folded;
}

double OrderLine::amplitude() const {
  return pieces > 0 ? std::sqrt(std::max(power / pieces, 0.0)) : 0.0;
}

double OrderLine::amplitude_sigma() const {
  if (pieces < 3) return std::numeric_limits<double>::infinity();
  const double mean = power / pieces;
  const double spread = std::max(power_squares / pieces - mean * mean, 0.0);
  const double sigma_power = std::sqrt((spread + 1e-300) / pieces);
  const double by_chance = 0.5 * sigma_power / std::max(amplitude(), std::sqrt(noise / pieces));
  return std::hypot(by_chance, kAmplitudeShare * amplitude());
}

double OrderLine::chi2() const {
  if (pieces < 3 || excess <= 0.0) return 0.0;
  return excess * excess / pieces;  // |A|^2 / noise is exponential: mean 1, variance 1
}

namespace {

// A few seconds of a speed: shaft angle, the smooth speed and the relative departure from it.
struct Piece {
  std::vector<double> angle, omega_rad_s, rest;
  double period_s = 0.0;
  double power_at(double order) const {
    std::complex<double> sum;
    for (std::size_t i = 0; i < rest.size(); ++i) {
      sum += rest[i] * std::polar(1.0, -order * angle[i]);
    }
    return std::norm(sum * (2.0 / static_cast<double>(rest.size())));
  }
};

// Share of an oscillation of omega rad/s that the local straight line follows: the mean of its
// window's samples (Dirichlet's kernel).
double followed(double omega, double period_s) {
  const double half = std::sin(0.5 * omega * period_s);
  if (std::abs(half) < 1e-9) return 1.0;
  const double reach = each_side(period_s);
  return std::sin((reach + 0.5) * omega * period_s) / ((2.0 * reach + 1.0) * half);
}

// What the smoothing leaves of a line at an order, mean; nothing where that is too little at any
// time.
std::optional<double> left_of(const Piece& piece, double order) {
  double sum = 0.0;
  for (const double omega : piece.omega_rad_s) {
    const double left = 1.0 - followed(order * omega, piece.period_s);
    if (left < kLeft) return std::nullopt;
    sum += left;
  }
  return sum / static_cast<double>(piece.omega_rad_s.size());
}

// The same as whether left_of knows; for two sines instead of two of each sample where the kernel's
// denominator alone says so: a sine is least at an end of what lies between 0 and pi.
bool is_left(const Piece& piece, double order) {
  const auto [least, most] =
      std::minmax_element(piece.omega_rad_s.begin(), piece.omega_rad_s.end());
  const double from = 0.5 * order * *least * piece.period_s;
  const double to = 0.5 * order * *most * piece.period_s;
  // Derived: far above the rounding of a sine, which must not call plain what left_of refuses; what
  // lies within is asked of left_of, so that no such number changes an answer (a fifth more or less
  // of what is above 1: the same bytes in 24 campaigns).
  constexpr double kRounding = 1.0 + 1e-9;
  const bool is_plain = from > 0.0 && to < std::numbers::pi &&
                        (2.0 * each_side(piece.period_s) + 1.0) * (1.0 - kLeft) *
                                std::min(std::sin(from), std::sin(to)) >
                            kRounding;
  return is_plain || left_of(piece, order).has_value();
}

std::vector<Piece> pieces_of(const Channel& speed) {
  std::vector<Piece> out;
  if (speed.t_s.size() < 100) return out;
  const double period_s = median_period_s(speed);
  if (!(period_s > 0.0)) return out;
  const std::vector<double> smooth = smoothed(speed, period_s);
  std::size_t begin = 0;
  while (begin < speed.t_s.size()) {
    std::size_t end = begin;
    Piece piece;
    double phi = 0.0;
    while (end < speed.t_s.size() && speed.t_s[end] < speed.t_s[begin] + kPiece_s) {
      if (end > begin) {
        // Not of the smooth speed: where that cuts a corner, the angle would stay wrong.
        phi +=
            0.5 * (speed.value[end] + speed.value[end - 1]) * (speed.t_s[end] - speed.t_s[end - 1]);
      }
      piece.angle.push_back(phi);
      piece.omega_rad_s.push_back(smooth[end]);
      piece.rest.push_back(speed.value[end] / smooth[end] - 1.0);
      ++end;
    }
    const double span_s = speed.t_s[end - 1] - speed.t_s[begin];
    piece.period_s = period_s;
    const bool usable = piece.rest.size() >= kSamplesMin && span_s > kPieceMin * kPiece_s &&
                        std::isfinite(phi) && phi > kLineSpeedMin_rad_s * span_s &&
                        std::all_of(piece.rest.begin(), piece.rest.end(), [](double v) {
                          return std::abs(v) < kRestMax;  // NaN fails as well
                        });
    if (usable) out.push_back(std::move(piece));
    begin = end;
  }
  return out;
}

}  // namespace

namespace {

// Mean of the neighbours that do not fold back themselves.
struct Noise {
  double mean = 0.0, count = 0.0;
  bool is_known() const { return mean > 0.0 && count > 2.0; }
};

Noise noise_about(const Piece& piece, double order) {
  Noise out;
  for (const double neighbour : kNeighbours) {
    if (!is_left(piece, neighbour * order)) continue;
    out.mean += piece.power_at(neighbour * order);
    out.count += 1.0;
  }
  out.mean /= std::max(out.count, 1.0);
  return out;
}

void add_piece(double here, const Noise& about, double left, OrderLine& out) {
  const double noise = about.mean;
  // The noise itself is a mean of a few: its inverse is biased by n / (n - 1).
  const double excess = here / noise * (about.count - 1.0) / about.count - 1.0;
  out.excess += std::min(excess, kExcessMax);
  const double power = (here - noise) / (left * left);
  out.power += power;
  out.power_squares += power * power;
  out.noise += noise;
  ++out.pieces;
}

}  // namespace

OrderLine order_line(const Channel& speed) {
  OrderLine out;
  for (const Piece& piece : pieces_of(speed)) {
    const std::optional<double> left = left_of(piece, 1.0);
    if (!left) {
      ++out.folded;
      continue;
    }
    const Noise noise = noise_about(piece, 1.0);
    if (noise.is_known()) add_piece(piece.power_at(1.0), noise, *left, out);
  }
  return out;
}

BeltLines belt_lines(const Channel& speed, double order) {
  BeltLines out;
  for (const Piece& piece : pieces_of(speed)) {
    const std::optional<double> left = left_of(piece, order);
    const Noise noise = noise_about(piece, order);
    if (!left || !noise.is_known()) continue;
    for (std::size_t i = 0; i < out.size(); ++i) {
      add_piece(piece.power_at(kBeltOrders[i] * order), noise, *left, out[i]);
    }
  }
  return out;
}

OrderSpectrum order_spectrum(const std::vector<SignalTable>& tables, Role role) {
  constexpr int kSteps = 160;
  constexpr double kStep = 0.02, kFirst = 0.2;
  std::vector<double> power(kSteps, 0.0);
  std::size_t count = 0;
  for (const SignalTable& table : tables) {
    const std::vector<Piece> pieces = pieces_of(table[role]);
    // A few of each experiment are enough for a picture.
    const std::size_t step = std::max<std::size_t>(1, pieces.size() / 4);
    for (std::size_t i = 0; i < pieces.size(); i += step, ++count) {
      for (int k = 0; k < kSteps; ++k) {
        power[static_cast<std::size_t>(k)] += pieces[i].power_at(kFirst + k * kStep);
      }
    }
  }
  OrderSpectrum out;
  for (int k = 0; count > 0 && k < kSteps; ++k) {
    out.order.push_back(kFirst + k * kStep);
    out.amplitude.push_back(
        std::sqrt(power[static_cast<std::size_t>(k)] / static_cast<double>(count)));
  }
  return out;
}

}  // namespace beltgrip::diagnose
