// Channels with stamps of their own, brought to instants and cells. Tools only.
#pragma once

#include <cstddef>
#include <optional>

#include "tools/diagnose/data/signal_table.h"

namespace beltgrip::calibrate {

// One channel, read forward in time.
class Series {
 public:
  explicit Series(const diagnose::Channel& channel);
  bool empty() const { return channel_.empty(); }
  double period_s() const { return period_s_; }  // median
  double begin_s() const { return channel_.t_s.front(); }
  double end_s() const { return channel_.t_s.back(); }
  // By linear interpolation; nothing in a gap of more than three periods, or outside.
  std::optional<double> at(double t_s) const;
  // Mean over [from, to) of what came in it; nothing with fewer than two values or a gap.
  std::optional<double> mean(double from_s, double to_s) const;
  // Mean square of the deviations from the mean over [from, to), where there is one.
  std::optional<double> variance(double from_s, double to_s) const;
  // The smallest step between values; 0: there is none.
  double resolution() const;

 private:
  std::size_t first_from(double t_s) const;
  const diagnose::Channel& channel_;
  double period_s_ = 0.0;
};

}  // namespace beltgrip::calibrate
