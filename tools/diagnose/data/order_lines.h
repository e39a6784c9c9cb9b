// Lines at once per revolution in a speed signal: run-out and pitch errors of its toothed wheel.
// From the channel's own samples, against the angle of its own shaft, so that speed changes and
// sampling below the line's frequency do not matter; where sampling folds the line back to about
// 0 Hz, the speed's own course lies there, and nothing is judged.
#pragma once

#include <array>

#include "tools/diagnose/data/signal_table.h"

namespace beltgrip::diagnose {

// Sums over pieces of a few seconds; pieces of several experiments add up.
struct OrderLine {
  int pieces = 0;
  double excess = 0.0;         // sum of |A|^2 / noise - 1
  double power = 0.0;          // sum of |A|^2 - noise
  double power_squares = 0.0;  // sum of its squares
  double noise = 0.0;          // sum of the noise's |A|^2
  int folded = 0;              // pieces left out: the line folds back to about 0 Hz
  void add(const OrderLine& other);
  double amplitude() const;
  double amplitude_sigma() const;
  double chi2() const;  // equivalent chi-square(1)
};

OrderLine order_line(const Channel& speed);

// Lines at the belt's passage, which no whole order is: its speed is that of the primary shaft
// times the running radius. The radius is known to a few percent: orders about the given one, these
// shares of it, within each as narrow as a piece resolves.
inline constexpr std::array kBeltOrders{0.96, 0.98, 1.0, 1.02, 1.04};
using BeltLines = std::array<OrderLine, kBeltOrders.size()>;
BeltLines belt_lines(const Channel& speed, double order);

// Amplitude of a speed's departure from its smooth course over the cycles per revolution of its
// shaft, share of the speed; empty where no piece is usable.
struct OrderSpectrum {
  std::vector<double> order, amplitude;
};
OrderSpectrum order_spectrum(const std::vector<SignalTable>& tables, Role role);

}  // namespace beltgrip::diagnose
