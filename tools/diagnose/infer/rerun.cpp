#include "tools/diagnose/infer/rerun.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "estimator/choice/make_estimator.h"
#include "estimator/method/slip_curve_estimator.h"
#include "estimator/physics/slip.h"
#include "estimator/signal/input_correction.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kStale_s = 0.05, kStalePeriods = 2.5;
constexpr int kConcludeMax = 100'000;  // calls; it needs some hundred

// A channel between its readings; times are asked for in rising order.
class Reader {
 public:
  explicit Reader(const Channel& channel)
      : channel_(channel), gap_s_(std::max(kStale_s, kStalePeriods * median_period_s(channel))) {}
  // No number in a gap.
  std::optional<double> at(double t_s) {
    const std::vector<double>& t = channel_.t_s;
    while (next_ + 1 < t.size() && t[next_] < t_s) ++next_;
    const double span_s = t[next_] - t[next_ - 1];
    const double share = (t_s - t[next_ - 1]) / span_s;
    const double value = std::lerp(channel_.value[next_ - 1], channel_.value[next_], share);
    if (span_s > gap_s_ || share < 0.0 || share > 1.0 || !std::isfinite(value)) return {};
    return value;
  }

 private:
  const Channel& channel_;
  std::size_t next_ = 1;
  double gap_s_ = 0.0;
};

}  // namespace

std::optional<daemon::ExperimentResult> estimate(const SignalTable& table, daemon::Config config) {
  const bool torque_is_engine = table[Role::kPrimaryTorque].empty();
  const std::array<const Channel*, 4> channels{
      &table[Role::kPrimarySpeed], &table[Role::kSecondarySpeed], &table[Role::kSecondaryPressure],
      &table[torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque]};
  double begin_s = 0.0, end_s = 1e300;
  std::vector<Reader> readers;
  for (const Channel* channel : channels) {
    if (channel->t_s.size() < 2) return {};
    begin_s = readers.empty() ? channel->t_s.front() : std::max(begin_s, channel->t_s.front());
    end_s = std::min(end_s, channel->t_s.back());
    readers.emplace_back(*channel);
  }

  // What a learned function may depend on; only those need it.
  const auto beside = [&](Role role) {
    return table[role].t_s.size() < 2 ? std::nullopt : std::optional<Reader>(table[role]);
  };
  std::optional<Reader> oil = beside(Role::kOilTemperature);
  std::optional<Reader> pressure_p = beside(Role::kPrimaryPressure);
  const auto read_of = [](std::optional<Reader>& reader, double t_s) {
    return reader ? reader->at(t_s).value_or(std::nan("")) : std::nan("");
  };

  config.estimator.torque_is_engine = torque_is_engine;
  const double rate_hz = config.estimator.sample_rate_hz;
  std::optional<estimator::InputCorrection> correction;
  if (config.corrected) {
    correction.emplace(*config.corrected, config.variator, rate_hz, config.learned);
  }
  const auto method =
      estimator::make_slip_curve_estimator(config.estimator, config.variator, config.sensors);
  method->reset();
  daemon::ExperimentResult out;
  for (std::int64_t i = 0;; ++i) {
    const double t_s = begin_s + static_cast<double>(i) / rate_hz;
    if (t_s > end_s || out.stopped) break;
    estimator::VariatorSample sample;
    sample.t_ns = std::llround(t_s * 1e9);
    std::array<double, 4> value{};
    sample.usable = true;
    for (std::size_t c = 0; c < value.size(); ++c) {
      const auto read = readers[c].at(t_s);
      sample.usable = sample.usable && read;
      value[c] = read.value_or(0.0);
    }
    sample.omega_p_rad_s = value[0];
    sample.omega_s_rad_s = value[1];
    sample.secondary_pressure_Pa = value[2];
    sample.torque_Nm = value[3];
    estimator::LearnedConditions now;
    now.oil_temperature_degC = read_of(oil, t_s);
    now.primary_pressure_Pa = read_of(pressure_p, t_s);
    const estimator::CurveEstimate& curve =
        method->step(correction ? correction->correct(sample, now) : sample);
    if (i == 0) out.start = daemon::MonoTime::of_ns(sample.t_ns);
    out.end = daemon::MonoTime::of_ns(sample.t_ns);
    out.stopped = curve.stop != estimator::StopReason::kNone;
    out.stop_reason = curve.stop;
    if (!curve.usable) continue;
    out.sigma_stop_percent = curve.sigma_star_percent;
    out.torque_Nm = curve.torque_p_Nm;
    out.clamp_force_N = curve.clamp_force_N;
    out.direction = curve.direction;
    out.end_stop = curve.end_stop;
  }
  for (int i = 0; i < kConcludeMax && !method->conclude(); ++i) {
  }
  out.peak = method->peak();
  return out;
}

std::optional<Measured> measured(const daemon::ExperimentResult& experiment,
                                 const estimator::VariatorParameters& variator) {
  if (experiment.peak.kind != estimator::PeakKind::kValue) return {};
  return Measured{experiment.peak.mu_max, experiment.sigma_stop_percent,
                  estimator::min_clamp_force_N(variator, experiment.end_stop, experiment.torque_Nm,
                                               experiment.peak.mu_max)};
}

}  // namespace beltgrip::diagnose
