#include "tools/diagnose/data/spectral_lines.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>

#include "estimator/statistics/order.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kSpectrumPiece_s = 1.0 / PooledSpectrum::kStep_Hz;
constexpr double kHighest = 0.45;  // of the sample rate: what lies above folds back
// Below, ramps and steps have their own power.
constexpr double kLowest_Hz = 2.0;
// The level on either side of a line, without the line. The higher one counts: the power of a
// course falls all the way, and its steps are no lines.
constexpr double kAround_Hz = 2.0, kOwn_Hz = 0.75;
constexpr int kPiecesMin = 12;                   // chosen: a mean of so many is known to a third
constexpr std::size_t kSpectrumSamplesMin = 60;  // per piece
// Chosen: what drives a machine has its own power below. A fifth less or more: the same verdicts of
// 25 healthy sets and eight whose shaft swings (371 to 450, and those of 1 to 370).
constexpr double kSwingLowest_Hz = 1.25;

std::size_t bin_of(double frequency_Hz) {
  return static_cast<std::size_t>(std::lround(frequency_Hz / PooledSpectrum::kStep_Hz));
}

// Samples that turn at once: one sample's phases wait for each other, those of several do not. Each
// sum takes them in their order, so that it is the same as of one at a time.
class Turns {
 public:
  // Derived: the doubles of a cache line. Decides speed alone.
  static constexpr std::size_t kAtOnce = 8;
  explicit Turns(std::size_t bins) : real_(bins), imaginary_(bins) {}

  void add(double y, std::complex<double> turn) {
    y_[count_] = y;
    turn_real_[count_] = turn.real();
    turn_imaginary_[count_] = turn.imag();
    if (++count_ == kAtOnce) take();
  }
  // Adds |sum|^2 / n of each bin.
  void finish(double n, std::vector<double>& power) {
    for (std::size_t i = count_; i < kAtOnce; ++i) y_[i] = turn_real_[i] = turn_imaginary_[i] = 0.0;
    if (count_ > 0) take();
    for (std::size_t i = 0; i < power.size(); ++i) {
      power[i] += (real_[i] * real_[i] + imaginary_[i] * imaginary_[i]) / n;
    }
  }

 private:
  void take() {
    std::array<double, kAtOnce> real, imaginary{};
    real.fill(1.0);
    for (std::size_t bin = 0; bin < real_.size(); ++bin) {
      double sum_real = real_[bin], sum_imaginary = imaginary_[bin];
      for (std::size_t i = 0; i < kAtOnce; ++i) {
        sum_real += y_[i] * real[i];
        sum_imaginary += y_[i] * imaginary[i];
      }
      real_[bin] = sum_real;
      imaginary_[bin] = sum_imaginary;
      for (std::size_t i = 0; i < kAtOnce; ++i) {
        const double was = real[i];
        real[i] = was * turn_real_[i] - imaginary[i] * turn_imaginary_[i];
        imaginary[i] = was * turn_imaginary_[i] + imaginary[i] * turn_real_[i];
      }
    }
    count_ = 0;
  }

  std::vector<double> real_, imaginary_;
  std::array<double, kAtOnce> y_{}, turn_real_{}, turn_imaginary_{};
  std::size_t count_ = 0;
};

// Without its straight line, through Hann's window: of a course that goes on, little is left.
void add_piece(const Channel& channel, std::size_t begin, std::size_t end,
               std::vector<double>& power) {
  const auto n = static_cast<double>(end - begin);
  double t0 = 0.0, y0 = 0.0;
  for (std::size_t i = begin; i < end; ++i) t0 += channel.t_s[i] / n, y0 += channel.value[i] / n;
  double tt = 0.0, ty = 0.0;
  for (std::size_t i = begin; i < end; ++i) {
    tt += (channel.t_s[i] - t0) * (channel.t_s[i] - t0);
    ty += (channel.t_s[i] - t0) * (channel.value[i] - y0);
  }
  const double slope = tt > 0.0 ? ty / tt : 0.0;
  Turns turns(power.size());
  for (std::size_t i = begin; i < end; ++i) {
    const double t = channel.t_s[i] - channel.t_s[begin];
    const double angle = 2.0 * std::numbers::pi * PooledSpectrum::kStep_Hz * t;
    const double window = 0.5 - 0.5 * std::cos(angle);
    const double y = window * (channel.value[i] - y0 - slope * (channel.t_s[i] - t0));
    turns.add(y, std::polar(1.0, -angle));
  }
  turns.finish(n, power);
}

}  // namespace

void PooledSpectrum::add(const PooledSpectrum& other) {
  power.resize(std::max(power.size(), other.power.size()), 0.0);
  for (std::size_t i = 0; i < other.power.size(); ++i) power[i] += other.power[i];
  pieces += other.pieces;
}

PooledSpectrum pooled_spectrum(const Channel& channel, double most_Hz) {
  PooledSpectrum out;
  const double period_s = channel.empty() ? 0.0 : median_period_s(channel);
  if (!(period_s > 0.0)) return out;
  const double highest_Hz = std::min(most_Hz, kHighest / period_s);
  if (highest_Hz < kLowest_Hz) return out;
  out.power.assign(bin_of(highest_Hz) + 1, 0.0);
  for (std::size_t begin = 0; begin < channel.t_s.size();) {
    std::size_t end = begin;
    while (end < channel.t_s.size() && channel.t_s[end] < channel.t_s[begin] + kSpectrumPiece_s)
      ++end;
    const bool whole = end < channel.t_s.size() &&
                       channel.t_s[end] - channel.t_s[begin] < kSpectrumPiece_s + 3.0 * period_s;
    if (whole && end - begin >= kSpectrumSamplesMin) {
      add_piece(channel, begin, end, out.power);
      ++out.pieces;
    }
    begin = end;
  }
  return out;
}

namespace {
double median_of(const std::vector<double>& power, std::size_t first, std::size_t last) {
  std::vector<double> near;
  for (std::size_t j = first; j <= std::min(last, power.size() - 1); ++j) near.push_back(power[j]);
  return estimator::median(near);
}
}  // namespace

NarrowLine narrow_line(const PooledSpectrum& spectrum) {
  NarrowLine out;
  const std::vector<double>& power = spectrum.power;
  const std::size_t lowest = bin_of(kLowest_Hz);
  if (spectrum.pieces < kPiecesMin || power.size() < lowest + bin_of(kAround_Hz)) return out;
  double whole = 0.0;
  for (std::size_t i = lowest; i < power.size(); ++i) whole += power[i];
  const std::size_t around = bin_of(kAround_Hz), own = bin_of(kOwn_Hz);
  for (std::size_t i = lowest; i + own + 2 < power.size(); ++i) {
    const double level = std::max(median_of(power, i > around ? i - around : 1, i - own - 1),
                                  median_of(power, i + own + 1, i + around));
    const double over = power[i] / std::max(level, 1e-300);
    if (over <= out.over_level) continue;
    double mass = 0.0, moment = 0.0;
    for (std::size_t j = i - 2; j <= i + 2; ++j) {
      const double here = std::max(0.0, power[j] - level);
      mass += here;
      moment += here * static_cast<double>(j);
    }
    out = {moment / std::max(mass, 1e-300) * PooledSpectrum::kStep_Hz, over, mass / whole};
  }
  return out;
}

double power_about(const PooledSpectrum& spectrum, std::size_t bin) {
  const std::vector<double>& power = spectrum.power;
  return bin > 0 && bin + 1 < power.size() ? power[bin - 1] + power[bin] + power[bin + 1] : 0.0;
}

Hump hump_at(const PooledSpectrum& spectrum, std::size_t bin) {
  const std::vector<double>& power = spectrum.power;
  const std::size_t lowest = bin_of(kSwingLowest_Hz);
  const std::size_t around = bin_of(kAround_Hz), own = bin_of(kOwn_Hz);
  if (spectrum.pieces < kPiecesMin || bin < lowest || bin + around >= power.size()) return {};
  const double level = std::max(median_of(power, bin > around ? bin - around : 1, bin - own),
                                median_of(power, bin + own, bin + around));
  const double mass = power_about(spectrum, bin);
  double whole = 0.0;
  for (std::size_t j = lowest; j < power.size(); ++j) whole += power[j];
  // Derived: of three neighbours through Hann's window one and a half are independent, and the
  // level's median is uncertain by half as much as they are.
  const double excess = (mass / std::max(3.0 * level, 1e-300) - 1.0) * std::sqrt(spectrum.pieces);
  return {static_cast<double>(bin) * PooledSpectrum::kStep_Hz, excess,
          std::max(0.0, mass - 3.0 * level) / whole};
}

Hump strongest_hump(const PooledSpectrum& spectrum) {
  Hump out;
  for (std::size_t bin = 0; bin < spectrum.power.size(); ++bin) {
    if (const Hump here = hump_at(spectrum, bin); here.excess > out.excess) out = here;
  }
  return out;
}

}  // namespace beltgrip::diagnose
