// What a monitor knows at one instant, as plain values: the model fills it, the layout shows it.
// Tools only.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/base/port.h"
#include "daemon/core/observe/carried_record.h"
#include "daemon/core/reasons/reasons.h"
#include "estimator/method/slip_curve_estimator.h"

namespace beltgrip::monitor {

using daemon::Reason;

struct CurvePoint {
  double sigma_star_percent = 0.0, mu_star = 0.0;
  estimator::Phase phase = estimator::Phase::kQuiet;
};

// The newest mu_max that was published.
struct Friction {
  estimator::PeakKind kind = estimator::PeakKind::kNone;
  double mu_max = 0.0, std = 0.0;
  double low() const { return mu_max - kNormal95 * std; }
  double high() const { return mu_max + kNormal95 * std; }
  static constexpr double kNormal95 = 1.96;
};

struct ExperimentRow {
  std::int64_t t_ns = 0;  // of its result
  std::string outcome, reason;
  Friction friction;
  double sigma_most_percent = 0.0;  // of all that was published since its start
};

struct InputRow {
  std::string role, unit;
  std::optional<double> value;  // in unit; a flag is 0 or 1
  bool is_flag = false;
  double age_s = 0.0;
  double rate_Hz = 0.0;
  std::string trust;     // "valid", "stale", ...
  double trust_s = 0.0;  // so long it is so
  bool good = false;
};

struct Traffic {
  double frames_per_s = 0.0;
  double bit_per_s = 0.0;          // without stuff bits
  std::optional<double> bitrate;   // of the bus; vcan has none
  std::uint64_t lost = 0;          // by the kernel
  std::uint64_t error_frames = 0;  // said by the controller
};

// BeltGrip's own frames that cannot be believed, with the newest of them in words.
struct Distrust {
  std::uint64_t wrong_crc = 0, wrong_sequence = 0, foreign_version = 0;
  std::string last;
};

struct Playing {
  double speed = 1.0;
  bool paused = false;
  bool ended = false;          // the log has no further frame
  bool duration_over = false;  // what --duration asked for was shown
  double position_s = 0.0;     // since the first frame
};

struct View {
  std::string source;              // interface, or name of the log
  std::optional<Playing> playing;  // of a log; on a bus only when it is held
  bool computed_here = false;      // the log has no frames of BeltGrip; these are this program's
  std::int64_t t_ns = 0;           // of the clock of the source
  std::int64_t wall_ns = 0;        // the same as time of day, since 1970
  daemon::BusState link = daemon::BusState::kActive;
  Traffic traffic;

  std::optional<double> silence_s;  // since the newest frame of BeltGrip; none: none has come
  double heard_s = 0.0;             // since the first
  double listening_s = 0.0;
  Distrust distrust;

  std::string state = "-", phase = "-", outcome = "-", reason = "-";
  std::string reason_means;
  bool in_experiment = false;
  bool stop = false;
  std::vector<Reason> faults;
  bool inhibits_known = false;
  std::vector<Reason> inhibits;

  std::optional<double> mu_star, sigma_star_percent, friction_slope;
  std::optional<double> force_asked_N, force_given_N, force_least_N;
  Friction friction;
  daemon::CarriedBounds carried{};  // seen since this monitor began, with a configuration
  unsigned experiment_count = 0;
  std::vector<CurvePoint> curve;           // of the experiment that runs, or of the last
  std::vector<ExperimentRow> experiments;  // newest last
  std::vector<InputRow> inputs;
};

// Nothing of BeltGrip has come for so long: beltgripd sends something every 100 ms.
inline constexpr double kSilence_s = 3.0;
inline bool is_silent(const View& view) {
  return view.silence_s.value_or(view.listening_s) >= kSilence_s;
}
std::string link_text(daemon::BusState link);

}  // namespace beltgrip::monitor
