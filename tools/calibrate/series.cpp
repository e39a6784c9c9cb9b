#include "tools/calibrate/series.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace beltgrip::calibrate {

namespace {
constexpr double kGap_periods = 3.0;
}

Series::Series(const diagnose::Channel& channel) : channel_(channel) {
  if (channel.t_s.size() > 1) period_s_ = diagnose::median_period_s(channel);
}

std::size_t Series::first_from(double t_s) const {
  return static_cast<std::size_t>(std::lower_bound(channel_.t_s.begin(), channel_.t_s.end(), t_s) -
                                  channel_.t_s.begin());
}

std::optional<double> Series::at(double t_s) const {
  const std::size_t next = first_from(t_s);
  if (next == channel_.t_s.size()) return std::nullopt;
  if (channel_.t_s[next] == t_s) return channel_.value[next];
  if (next == 0) return std::nullopt;
  const double before = channel_.t_s[next - 1];
  const double width = channel_.t_s[next] - before;
  if (width > kGap_periods * period_s_) return std::nullopt;
  const double share = (t_s - before) / width;
  return channel_.value[next - 1] + share * (channel_.value[next] - channel_.value[next - 1]);
}

std::optional<double> Series::mean(double from_s, double to_s) const {
  const std::size_t begin = first_from(from_s);
  const std::size_t end = first_from(to_s);
  if (end < begin + 2) return std::nullopt;
  double sum = 0.0;
  double last = from_s;
  for (std::size_t i = begin; i < end; ++i) {
    if (channel_.t_s[i] - last > kGap_periods * period_s_) return std::nullopt;
    last = channel_.t_s[i];
    sum += channel_.value[i];
  }
  if (to_s - last > kGap_periods * period_s_) return std::nullopt;
  return sum / static_cast<double>(end - begin);
}

std::optional<double> Series::variance(double from_s, double to_s) const {
  const auto middle = mean(from_s, to_s);
  if (!middle) return std::nullopt;
  const std::size_t begin = first_from(from_s);
  const std::size_t end = first_from(to_s);
  double sum = 0.0;
  for (std::size_t i = begin; i < end; ++i) {
    sum += (channel_.value[i] - *middle) * (channel_.value[i] - *middle);
  }
  return sum / static_cast<double>(end - begin);
}

double Series::resolution() const {
  double smallest = 0.0;
  for (std::size_t i = 1; i < channel_.value.size(); ++i) {
    const double step = std::abs(channel_.value[i] - channel_.value[i - 1]);
    const double rounding = 1e-9 * std::abs(channel_.value[i]);
    if (step > rounding && (smallest == 0.0 || step < smallest)) smallest = step;
  }
  return smallest;
}

}  // namespace beltgrip::calibrate
