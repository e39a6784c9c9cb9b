// What the frames of a bus show of every role, beside the daemon's own inputs and more lenient than
// they are: a frame that the daemon would refuse is looked at, and why it would be refused is
// counted. Streaming, bounded memory. Tools only.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "daemon/core/base/port.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/input/input_monitor.h"
#include "tools/check/thinned.h"

namespace beltgrip::check {

using daemon::MonoTime;
using daemon::Role;

struct Gap {
  double begin_s = 0.0;
  double length_s = 0.0;
};

// One role, over all logs. Values in SI.
struct RoleCourse {
  const daemon::RoleBinding* binding = nullptr;
  std::uint64_t frames = 0;       // of its message
  std::uint64_t wrong_kind = 0;   // of those: length, or classic for FD
  std::uint8_t other_length = 0;  // of the last of those
  std::uint64_t crc_bad = 0;
  std::uint64_t counter_still = 0, counter_jumps = 0;
  std::uint32_t counter_last = 0;
  std::uint64_t not_selected = 0;  // by the multiplexer
  std::uint64_t values = 0;        // the signal was in the frame
  std::uint64_t in_range = 0;      // of those
  double out_of_range = 0.0;       // the last of those, physical value
  double first_s = 0.0, last_s = 0.0;
  double value = 0.0, least = 0.0, largest = 0.0;
  double stuck_s = 0.0;  // longest stretch of equal values
  // A shaft's longest stretch of equal values while it turns.
  double stood_s = 0.0, stood_from_s = 0.0, stood_at = 0.0;
  std::uint64_t stood_values = 0;
  // Of stretches of equal values of a shaft the one behind which it moved most in one frame.
  double leap = 0.0, leap_stood_s = 0.0, leap_from_s = 0.0, leap_at = 0.0;
  Thinned<double> moves;  // from one value to the next, where they differ and none stood before
  // A pulley's longest stretch at a speed while the other's moved, by this share.
  double frozen_s = 0.0, frozen_from_s = 0.0, frozen_at = 0.0, frozen_other = 0.0;
  bool frozen_against = false;  // the other went the way that slip does not go
  std::uint64_t changes = 0;
  double step = 0.0;  // greatest common step of its raw values; 0: it never moved
  double longest_gap_s = 0.0;
  std::uint64_t gap_count = 0;
  double span_s = 0.0;                         // of its frames, pauses between logs left out
  double silent_s = 0.0, silent_from_s = 0.0;  // longest end, or beginning, of a log without it
  std::vector<Gap> gaps;                       // the first ones
  Thinned<double> spread;                      // values
  Thinned<double> intervals_s;
  // From diagnostics: how often somebody asked, and how long the answers took.
  std::uint64_t requests = 0;
  Thinned<double> asked_every_s;
  Thinned<double> answers_s;
  Thinned<double> bends;               // second differences
  Thinned<double> live_bends;          // of those, where its values do not repeat
  std::vector<can::CanFrame> refused;  // the first whose CRC is wrong

  double rate_Hz() const;
  double noise() const;       // standard deviation of white noise on it
  double live_noise() const;  // where its values do not repeat
};

struct Heard {
  std::uint64_t frames = 0;
  std::uint8_t length = 0;
  bool fd = false;
  MonoTime first = MonoTime::origin(), last = MonoTime::origin();
};
using Census = std::map<std::pair<std::uint8_t, can::CanId>, Heard>;

class RoleWatch {
 public:
  explicit RoleWatch(const daemon::Config& config);

  void begin_log();  // what follows has another clock
  void end_log();    // after the last frame of each
  void on_frame(const daemon::RxFrame& frame);

  const std::vector<RoleCourse>& roles() const { return courses_; }
  const RoleCourse* find(Role role) const;
  const Census& census() const { return census_; }
  std::uint64_t frames() const { return frames_; }
  double span_s() const { return span_s_ + last_span_s_; }
  // In which no frame at all came.
  std::uint64_t pauses() const { return pauses_; }
  double longest_pause_s() const { return longest_pause_s_; }

 private:
  // What goes on from frame to frame within one log.
  struct State {
    bool heard = false;
    MonoTime heard_at = MonoTime::origin();
    double begun_s = 0.0;
    bool behind_gap = false;
    std::optional<std::uint32_t> counter;
    int known = 0;  // values in a row, for differences: 0, 1, 2
    double previous = 0.0, before = 0.0;
    bool same = false;  // as the last value
    double same_since_s = 0.0;
    std::uint64_t same_values = 0;
    double other_at_same = 0.0;
    std::optional<std::uint64_t> raw;
    MonoTime diagnostics = MonoTime::origin();
    std::optional<MonoTime> asked_at;  // last
    bool waits = false;                // for its answer
  };
  void take_pause(MonoTime t);
  void take_frame(RoleCourse& course, State& state, const daemon::RxFrame& frame);
  void take_diagnostics(RoleCourse& course, State& state, const daemon::UdsSource& source,
                        const daemon::RxFrame& frame);
  bool protection_holds(RoleCourse& course, State& state, const can::CanFrame& frame);
  void take_time(RoleCourse& course, State& state, MonoTime t);
  void take_value(RoleCourse& course, State& state, double value, double t_s);
  double other_pulley(Role role) const;
  void take_stand(RoleCourse& course, const State& state, double other, double t_s) const;
  void take_move(RoleCourse& course, const State& state, double value, double t_s) const;
  bool slip_explains(Role role, double other_moved) const;

  daemon::Config config_;
  std::vector<RoleCourse> courses_;
  std::vector<State> states_;
  std::optional<daemon::InputMonitor> diagnostics_;  // where a role comes from answers
  daemon::FaultSet faults_;
  Census census_;
  std::uint64_t frames_ = 0;
  double span_s_ = 0.0, last_span_s_ = 0.0;
  std::optional<MonoTime> first_, newest_;
  std::uint64_t pauses_ = 0;
  double longest_pause_s_ = 0.0;
};

}  // namespace beltgrip::check
