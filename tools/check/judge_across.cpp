#include "tools/check/judge_across.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <string>

#include "estimator/method/possible_friction.h"
#include "tools/check/text.h"
#include "tools/check/thresholds.h"

namespace beltgrip::check {

namespace {

double share_of(const std::vector<double>& values, const auto& holds) {
  if (values.empty()) return 0.0;
  return static_cast<double>(std::count_if(values.begin(), values.end(), holds)) /
         static_cast<double>(values.size());
}

// Relative distance between the quarters.
double spread_of(const std::vector<double>& values) {
  return quantile(values, 0.9) / quantile(values, 0.1) - 1.0;
}

// Of two pulleys the one that the engine is fixed to, even where slow sampling blurs it.
bool turns_with(const std::vector<double>& engine_this, const std::vector<double>& engine_other) {
  return engine_this.size() >= kWindowsLeast && engine_other.size() >= kWindowsLeast &&
         kSteadier * spread_of(engine_this) < spread_of(engine_other);
}

bool is_one(const std::vector<double>& values) {
  return values.size() >= kWindowsLeast && std::abs(quantile(values, 0.5) - 1.0) < kSameSpeed &&
         share_of(values, [](double r) { return std::abs(r - 1.0) < kSameSpeedOnce; }) >
             kOneShaftLeast;
}

double correlation(const std::vector<double>& x, const std::vector<double>& y) {
  const auto n = static_cast<double>(x.size());
  double mx = 0.0, my = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    mx += x[i] / n;
    my += y[i] / n;
  }
  double xx = 0.0, yy = 0.0, xy = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    xx += (x[i] - mx) * (x[i] - mx);
    yy += (y[i] - my) * (y[i] - my);
    xy += (x[i] - mx) * (y[i] - my);
  }
  return xx > 0.0 && yy > 0.0 ? xy / std::sqrt(xx * yy) : 0.0;
}

double deviation(const std::vector<double>& values) {
  double mean = 0.0, square = 0.0;
  for (const double v : values) mean += v / static_cast<double>(values.size());
  for (const double v : values) square += (v - mean) * (v - mean);
  return values.empty() ? 0.0 : std::sqrt(square / static_cast<double>(values.size()));
}

class Across {
 public:
  Across(const std::vector<Window>& windows, const daemon::Config& config)
      : windows_(windows), config_(config) {}

  Findings run() {
    one_signal_twice();
    doubtful_ = speeds();
    if (!doubtful_) lockup();
    torque_sign();
    pedal();
    if (!doubtful_) {
      mass();
      slip_direction();
      carried();
      pressure_course();
      pressure_command();
    }
    return found_;
  }

 private:
  void wrong(std::string text) { found_.push_back({Weight::kWrong, std::move(text)}); }
  void doubt(std::string text) { found_.push_back({Weight::kDoubt, std::move(text)}); }
  void note(std::string text) { found_.push_back({Weight::kNote, std::move(text)}); }

  std::vector<double> ratio_of(Role above, Role below, bool closed_only) const;
  double slipped_beyond_share() const;
  bool is_bound(Role role) const {
    return std::any_of(config_.roles.begin(), config_.roles.end(),
                       [role](const daemon::RoleBinding& each) { return each.role == role; });
  }
  Role torque_role() const {
    return config_.estimator.torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque;
  }
  bool is_assumed(const char* key) const {
    return std::find(config_.assumed.begin(), config_.assumed.end(), std::string(key)) !=
           config_.assumed.end();
  }
  std::string swapped_too() const { return either_way_ ? ", or the two speeds are swapped" : ""; }
  void one_signal_twice();
  struct Speeds;
  Speeds speeds_read() const;
  bool speeds();
  bool speeds_swapped(const Speeds& s);
  static std::string causes_of_ratio(const Speeds& s);
  std::optional<bool> ratio_beyond_stops(const Speeds& s);
  bool ratio_at_other_stop(const Speeds& s);
  bool level_by_wheels(const Speeds& s);
  void level_by_engine(const Speeds& s);
  void lockup();
  void torque_sign();
  void pedal();
  void slip_direction();
  double most_against_percent() const;
  double against_in_percent(std::size_t from, std::size_t to) const;
  void carried();
  void mass();
  void pressure_course();
  void pressure_command();

  const std::vector<Window>& windows_;
  const daemon::Config& config_;
  Findings found_;
  bool doubtful_ = false;
  bool either_way_ = false;  // the speeds could be swapped, and nothing else tells
};

void Across::one_signal_twice() {
  for (const daemon::RoleBinding& a : config_.roles) {
    for (const daemon::RoleBinding& b : config_.roles) {
      if (a.role >= b.role || a.uds || b.uds || a.id != b.id || a.bus != b.bus) continue;
      if (a.signal_name != b.signal_name || a.true_when != b.true_when) continue;
      const auto engine_for_turbine = [](Role x, Role y) {  // a lock-up that is closed for good
        return x == Role::kPrimarySpeed && y == Role::kEngineSpeed;
      };
      if (engine_for_turbine(a.role, b.role)) continue;
      wrong(std::string(daemon::role_name(a.role)) + " and " +
            std::string(daemon::role_name(b.role)) + " are one signal, " + a.message_name + "." +
            a.signal_name);
    }
  }
}

// Of the windows in which both turn.
std::vector<double> Across::ratio_of(Role above, Role below, bool closed_only) const {
  std::vector<double> ratios;
  for (const Window& window : windows_) {
    if (!(window[above] > 0.0) || !(window[below] > 0.0)) continue;
    const bool shaft = above != Role::kVehicleSpeed;
    if (window[below] < kMoving_rad_s && (shaft ? window[above] : kMoving_rad_s) < kMoving_rad_s) {
      continue;
    }
    if (closed_only && !(window[Role::kLockupClosed] == 1.0)) continue;
    ratios.push_back(window[above] / window[below]);
  }
  return ratios;
}

// Share of the windows that lie beyond the end stops with so much more torque for their pressure
// than those at a stop that it is slip: a clamp was lowered past the peak.
double Across::slipped_beyond_share() const {
  const double low = config_.variator.ratio_low, overdrive = config_.variator.ratio_overdrive;
  std::vector<double> loads_at_stop, loads_beyond;
  std::size_t turning = 0;
  for (const Window& window : windows_) {
    const double primary = window[Role::kPrimarySpeed], secondary = window[Role::kSecondarySpeed];
    if (!(primary > kMoving_rad_s) || !(secondary > 0.0)) continue;
    ++turning;
    const double ratio = secondary / primary;
    const double load = std::abs(window[torque_role()]) / window[Role::kSecondaryPressure];
    if (!std::isfinite(load)) continue;
    const bool with_torque =
        ratio > 1.0 ? window[torque_role()] < 0.0 : window[torque_role()] > 0.0;
    const bool beyond = ratio < low * (1.0 - kSlipBand) || ratio > overdrive * (1.0 + kSlipBand);
    if (beyond && with_torque) {
      loads_beyond.push_back(load);
    } else if (std::abs(ratio / low - 1.0) < kSlipBand ||
               std::abs(ratio / overdrive - 1.0) < kSlipBand) {
      loads_at_stop.push_back(load);
    }
  }
  if (loads_at_stop.size() < kWindowsLeast) return 0.0;
  const double lowered = kLoweredLeast * quantile(loads_at_stop, 0.5);
  const auto count = std::count_if(loads_beyond.begin(), loads_beyond.end(),
                                   [lowered](double load) { return load >= lowered; });
  return static_cast<double>(count) / static_cast<double>(std::max<std::size_t>(turning, 1));
}

// What the speeds say of each other.
struct Across::Speeds {
  double low = 0.0, overdrive = 0.0;  // as configured
  std::string stops;
  std::vector<double> ratio;
  std::vector<double> by_secondary, by_primary;          // the vehicle's, over the pulley's
  std::vector<double> engine_primary, engine_secondary;  // the engine's, over the pulley's
  bool closed_only = false;                              // with the lock-up closed

  double inside_share(double factor, bool inverted) const {
    return share_of(ratio, [&](double r) {
      const double as_meant = factor * (inverted ? 1.0 / r : r);
      return as_meant > low * (1.0 - kSlipBand) && as_meant < overdrive * (1.0 + kSlipBand);
    });
  }
  double share_at(double a, double b, double band) const {
    const auto at = [band](double r, double stop) { return std::abs(r / stop - 1.0) < band; };
    return share_of(ratio, [&](double r) { return at(r, a) || at(r, b); });
  }
  // Where a stop would be if the shafts were swapped.
  bool stays_at_other_stop(double band) const {
    return share_at(1.0 / low, 1.0 / overdrive, band) > kStaysLeast &&
           share_at(low, overdrive, band) < kPasses;
  }
};

Across::Speeds Across::speeds_read() const {
  Speeds s;
  s.low = config_.variator.ratio_low;
  s.overdrive = config_.variator.ratio_overdrive;
  s.stops =
      format("%.3g to %.3g", s.low, s.overdrive) +
      (is_assumed("variator.ratio_low") || is_assumed("variator.ratio_overdrive") ? " (assumed)"
                                                                                  : "");
  s.ratio = ratio_of(Role::kSecondarySpeed, Role::kPrimarySpeed, false);
  s.by_secondary = ratio_of(Role::kVehicleSpeed, Role::kSecondarySpeed, false);
  s.by_primary = ratio_of(Role::kVehicleSpeed, Role::kPrimarySpeed, false);
  s.closed_only = is_bound(Role::kLockupClosed);
  s.engine_primary = ratio_of(Role::kEngineSpeed, Role::kPrimarySpeed, s.closed_only);
  s.engine_secondary = ratio_of(Role::kEngineSpeed, Role::kSecondarySpeed, s.closed_only);
  return s;
}

// True: something is wrong with them, and what rests on them would accuse others.
bool Across::speeds() {
  const Speeds s = speeds_read();
  if (s.ratio.size() < kWindowsLeast) return false;
  if (speeds_swapped(s)) return true;
  if (const std::optional<bool> beyond = ratio_beyond_stops(s)) return *beyond;
  either_way_ =
      s.inside_share(1.0, true) > kExplains && s.by_secondary.empty() && s.engine_primary.empty();
  if (ratio_at_other_stop(s) || level_by_wheels(s)) return true;
  level_by_engine(s);
  return false;
}

// Which pulley turns with the wheels, and which with the engine.
bool Across::speeds_swapped(const Speeds& s) {
  const bool wheels_by_primary = s.by_primary.size() >= kWindowsLeast &&
                                 spread_of(s.by_primary) < kFinalDriveSpread &&
                                 spread_of(s.by_secondary) > kOtherSpread;
  const bool engine_by_secondary = is_one(s.engine_secondary) && !is_one(s.engine_primary);
  if (!wheels_by_primary && !engine_by_secondary) return false;
  wrong(std::string("primary_speed and secondary_speed are swapped: ") +
        (wheels_by_primary
             ? format("the vehicle's speed keeps to the primary within %.1f %%, to the "
                      "secondary within %.0f %%",
                      100.0 * spread_of(s.by_primary), 100.0 * spread_of(s.by_secondary))
             : format("the engine turns %.3f times as fast as the secondary, %.3f times as "
                      "fast as the primary",
                      quantile(s.engine_secondary, 0.5), quantile(s.engine_primary, 0.5))));
  return true;
}

// Which mistakes in the two speeds would bring the ratio between the end stops.
std::string Across::causes_of_ratio(const Speeds& s) {
  struct Reading {
    const char* text;
    double factor;
    bool inverted;
  };
  constexpr std::array kReadings{
      Reading{"primary and secondary swapped", 1.0, true},
      Reading{"primary 1/min read as rad/s (or secondary rad/s as 1/min)", kPerMinute, false},
      Reading{"primary rad/s read as 1/min (or secondary 1/min as rad/s)", 1.0 / kPerMinute,
              false}};
  std::string causes;
  const bool engine_on_primary = turns_with(s.engine_primary, s.engine_secondary);
  for (const Reading& reading : kReadings) {
    if (reading.inverted && engine_on_primary) continue;
    if (s.inside_share(reading.factor, reading.inverted) < kExplains) continue;
    causes += (causes.empty() ? "" : ", or ") + std::string(reading.text);
  }
  return causes;
}

// A ratio that lies beyond the end stops, as speeds() has it; none: it lies between them.
std::optional<bool> Across::ratio_beyond_stops(const Speeds& s) {
  const double inside_share = s.inside_share(1.0, false), usual = quantile(s.ratio, 0.5);
  const bool mostly_beyond =
      usual < s.low * (1.0 - kSlipBand) || usual > s.overdrive * (1.0 + kStopBand);
  if (inside_share >= kInStopsLeast && !mostly_beyond) return std::nullopt;
  const std::string text =
      format("speed ratio %.3g to %.3g, end stops %s: ", quantile(s.ratio, 0.01),
             quantile(s.ratio, 0.99), s.stops.c_str());
  if (const std::string causes = causes_of_ratio(s); !causes.empty()) {
    wrong(text + causes + "?");
    return true;
  }
  if (mostly_beyond) {
    wrong(text + "a scale of one speed, or the end stops are another variator's");
    return true;
  }
  const double beyond_share = 1.0 - inside_share;
  if (beyond_share - slipped_beyond_share() >= 1.0 - kInStopsLeast) {
    doubt(text + format("%.0f %% of the time beyond them; a scale, or another variator's stops",
                        100.0 * beyond_share));
  }
  return false;
}

bool Across::ratio_at_other_stop(const Speeds& s) {
  if (is_one(s.engine_primary)) return false;
  if (!s.stays_at_other_stop(kStopBand) && !s.stays_at_other_stop(kSlipBand)) return false;
  doubt(
      format("speed ratio stays at %.3f: at no end stop (%s), but 1 / %.3f is at one; primary "
             "and secondary swapped?",
             quantile(s.ratio, 0.5), s.stops.c_str(), quantile(s.ratio, 0.5)));
  return true;
}

bool Across::level_by_wheels(const Speeds& s) {
  if (s.by_secondary.size() < kWindowsLeast) return false;
  const double radius_m = quantile(s.by_secondary, 0.5);
  if (radius_m >= kFinalDriveLeast_m && radius_m <= kFinalDriveMost_m) return false;
  const double per_minute = radius_m < kFinalDriveLeast_m ? kPerMinute : 1.0 / kPerMinute;
  const double with = radius_m * per_minute;
  const bool by_unit = with > kFinalDriveLeast_m && with < kFinalDriveMost_m;
  wrong(
      format("the car goes %.3g m a radian of the secondary, cars go 0.04 to 0.08 m: ", radius_m) +
      (by_unit ? radius_m < kFinalDriveLeast_m ? "speeds in 1/min read as rad/s?"
                                               : "speeds in rad/s read as 1/min?"
               : "unit or scale of vehicle_speed or secondary_speed?"));
  return true;
}

void Across::level_by_engine(const Speeds& s) {
  if (s.engine_primary.size() < kWindowsLeast || !s.closed_only || is_one(s.engine_primary)) return;
  const double usual = quantile(s.engine_primary, 0.5);
  const auto near = [](double a, double b) { return std::abs(a / b - 1.0) < kStopBand; };
  const bool steady =
      share_of(s.engine_primary, [&](double r) { return near(r, usual); }) > kMostly;
  if (!steady || !(near(usual, kPerMinute) || near(usual, 1.0 / kPerMinute))) return;
  wrong(
      format("the engine turns %.3f times as fast as the primary with the lock-up closed: "
             "1/min and rad/s mixed up?",
             usual));
}

// A lock-up clutch that is closed while the car stands would stall the engine; one that is closed
// makes engine and primary one shaft.
void Across::lockup() {
  if (!is_bound(Role::kLockupClosed)) return;
  double standing_s = 0.0, closed_s = 0.0, braked_s = 0.0;
  for (const Window& window : windows_) {
    if (!(window[Role::kLockupClosed] > kFlagOn)) continue;
    closed_s += kWindow_s;
    const double secondary = window[Role::kSecondarySpeed];
    if (std::isfinite(secondary) && std::abs(secondary) < kStanding_rad_s) standing_s += kWindow_s;
    if (window[Role::kBrakePressed] > 0.5) braked_s += kWindow_s;
  }
  const std::vector<double> engine = ratio_of(Role::kEngineSpeed, Role::kPrimarySpeed, true);
  const bool geared =
      turns_with(engine, ratio_of(Role::kEngineSpeed, Role::kSecondarySpeed, true)) &&
      std::abs(quantile(engine, 0.5) - 1.0) < kGearMost;
  const double together =
      share_of(engine, [](double r) { return std::abs(r - 1.0) < kSameSpeedOnce; });
  const bool apart = engine.size() >= kWindowsLeast && together < 0.5 &&
                     std::abs(quantile(engine, 0.5) - 1.0) < 1.0;
  if (standing_s >= kStandsClosed_s) {
    wrong(
        format("lockup_closed for %.1f s while the secondary stands: a closed lock-up would stall "
               "the engine; is it the brake, or true_when the wrong way round?",
               standing_s));
  } else if (apart && geared) {
    doubt(
        format("with lockup_closed the engine turns %.3g times as fast as the primary: a gear "
               "between them? Then engine_torque times that is the primary's (scale)",
               quantile(engine, 0.5)));
  } else if (apart) {
    wrong(
        format("with lockup_closed the engine turns %.3g times as fast as the primary, and within "
               "%.0f %% of it for %.0f %% of the time only: another signal, or true_when",
               quantile(engine, 0.5), 400.0 * kSameSpeed, 100.0 * together));
  } else if (closed_s > kStandsClosed_s && is_bound(Role::kBrakePressed) &&
             braked_s > kMostly * closed_s) {
    doubt(format("lockup_closed only while the brake is pressed (%.1f of %.1f s): is it the brake?",
                 braked_s, closed_s));
  }
  // Open, and yet one shaft all the time.
  std::vector<double> open;
  for (const Window& window : windows_) {
    if (!(window[Role::kLockupClosed] < kFlagOff) || !(window[Role::kEngineSpeed] > 0.0)) continue;
    if (!(window[Role::kPrimarySpeed] > kMoving_rad_s)) continue;
    open.push_back(window[Role::kEngineSpeed] / window[Role::kPrimarySpeed]);
  }
  const double as_one = share_of(open, [](double r) { return std::abs(r - 1.0) < kSameSpeed; });
  if (open.size() >= 4 * kWindowsLeast && as_one > kMostly) {
    doubt(
        format("lockup_closed is 0 while engine and primary turn as one (within %.1f %% for "
               "%.0f %% of %.0f s): true_when or scale the wrong way round?",
               100.0 * kSameSpeed, 100.0 * as_one, kWindow_s * static_cast<double>(open.size())));
  }
}

void Across::torque_sign() {
  const Role role = torque_role();
  std::vector<double> torque, acceleration, pressed, released;
  for (const Window& window : windows_) {
    const double now = window[role];
    // The wheels', or of both pulleys the one that is there.
    const double turns = window[Role::kSecondarySpeed];
    if (!std::isfinite(now) || !(turns > kMoving_rad_s)) continue;
    if (window[Role::kBrakePressed] > 0.0) continue;
    torque.push_back(now);
    acceleration.push_back(window.rate(Role::kSecondarySpeed) / turns);
    const double pedal = window[Role::kAcceleratorPedal];
    const bool locked = !(window[Role::kLockupClosed] < 1.0);
    if (pedal > kPedalPressed) pressed.push_back(now);
    if (pedal < kPedalReleased && locked && window[Role::kPrimarySpeed] > kOverrunLeast_rad_s) {
      released.push_back(now);
    }
  }
  const double usual_pressed = quantile(pressed, 0.5), usual_released = quantile(released, 0.5);
  const bool against_pedal = pressed.size() >= kWindowsLeast && usual_pressed < -kTorqueSigned_Nm;
  const bool against_release =
      released.size() >= kWindowsLeast && usual_released > kTorqueSigned_Nm;
  const double together = torque.size() >= 4 * kWindowsLeast && deviation(torque) > kTorqueSpread_Nm
                              ? correlation(torque, acceleration)
                              : 0.0;
  const std::string name(daemon::role_name(role));
  std::string text;
  if (against_pedal) {
    text += format("%.0f Nm with the accelerator pressed", usual_pressed);
  }
  if (against_release) {
    text += (text.empty() ? "" : ", ") + format("%+.0f Nm with it released", usual_released);
  }
  if (together < kTorqueAgainst) {
    text += (text.empty() ? "" : ", ") +
            format("the car gains speed as the torque falls (correlation %.2f)", together);
  }
  if (text.empty()) return;
  // Cruise control drives with the pedal released; downhill a car gains speed in overrun.
  const bool sure = against_pedal || (against_release && together < kTorqueAgainst);
  if (sure) {
    wrong(name + ": sign? " + text);
  } else {
    doubt(name + ": sign? " + text);
  }
}

// A driver who comes and goes between drive and overrun moves the pedal.
void Across::pedal() {
  double least = std::numeric_limits<double>::infinity(), most = -least, side = 0.0;
  int turns = 0;
  for (const Window& window : windows_) {
    const double pedal = window[Role::kAcceleratorPedal], torque = window[torque_role()];
    if (!std::isfinite(pedal) || !(std::abs(torque) > kTorqueSigned_Nm)) continue;
    least = std::min(least, pedal), most = std::max(most, pedal);
    if (side * torque < 0.0) ++turns;
    side = torque;
  }
  if (turns < kTurnsOfTorque || most > least) return;
  doubt(
      format("accelerator_pedal is always %.3g %% while the torque goes between drive and overrun "
             "%d times: the right signal?",
             100.0 * least, turns));
}

// Where the clamp is lowered the belt slips with the torque, never against it: sigma* there is
// positive.
void Across::slip_direction() {
  double against_percent = most_against_percent();
  std::vector<double> friction;
  for (const Window& window : windows_) {
    if (std::isfinite(window.mu_star)) friction.push_back(window.mu_star);
  }
  const double usual = quantile(friction, 0.5), high = quantile(friction, 1.0 - kCarriedShare);
  // Else nobody lowered it.
  if (friction.size() >= kWindowsLeast && high >= kLoweredLeast * usual) {
    std::vector<double> slip_percent;
    for (const Window& window : windows_) {
      if (window.mu_star >= high) slip_percent.push_back(window.slip_percent);
    }
    against_percent = std::max(against_percent, -quantile(slip_percent, 0.5));
  }
  if (against_percent < kSlipAgainst_percent) return;
  doubt(
      format("where the clamp was lowered most the belt slips by %.1f %% against the torque, never "
             "with it: sign of ",
             against_percent) +
      std::string(daemon::role_name(torque_role())) + ", or the two speeds are swapped?");
}

// The same where slip carries the ratio away from its stop: of driving in which neither speed moves
// much, and which begins and ends at a stop, the window that lies furthest from it of those with
// much torque for their pressure.
double Across::against_in_percent(std::size_t from, std::size_t to) const {
  const auto log_ratio = [&](std::size_t i) {
    return std::log(windows_[i][Role::kSecondarySpeed] / windows_[i][Role::kPrimarySpeed]);
  };
  const auto load = [&](std::size_t i) {
    return std::abs(windows_[i][torque_role()]) / windows_[i][Role::kSecondaryPressure];
  };
  // Or where it would be if the speeds were swapped.
  const auto at_stop = [&](std::size_t i) {
    const double there = std::abs(log_ratio(i));
    return std::abs(there + std::log(config_.variator.ratio_low)) < kStopBand ||
           std::abs(there - std::log(config_.variator.ratio_overdrive)) < kStopBand;
  };
  if (to - from < kWindowsLeast || !at_stop(from) || !at_stop(to - 1)) return 0.0;
  const double begin = log_ratio(from), end = log_ratio(to - 1);
  if (std::abs(begin - end) > kBackAtStop) return 0.0;
  const double lowered = kLoweredLeast * std::max(load(from), load(to - 1));
  double moved = 0.0;
  for (std::size_t i = from; i < to; ++i) {
    const double off = log_ratio(i) - 0.5 * (begin + end);
    if (load(i) >= lowered && std::abs(off) > std::abs(moved)) moved = off;
  }
  return 100.0 * (windows_[from][torque_role()] > 0.0 ? moved : -moved);
}

double Across::most_against_percent() const {
  double most = 0.0, with = 0.0;
  const auto turns = [&](std::size_t i) {
    const Window& window = windows_[i];
    return window[Role::kPrimarySpeed] > kMoving_rad_s &&
           window[Role::kSecondarySpeed] > kMoving_rad_s &&
           window[Role::kSecondaryPressure] > 0.0 &&
           std::abs(window[torque_role()]) > kTorqueSigned_Nm;
  };
  const auto goes_on = [&](std::size_t first, std::size_t i) {
    const auto near = [&](Role role) {
      return std::abs(windows_[i][role] / windows_[first][role] - 1.0) < kSteadySpeeds;
    };
    return turns(i) && near(Role::kPrimarySpeed) && near(Role::kSecondarySpeed) &&
           windows_[i][torque_role()] * windows_[first][torque_role()] > 0.0;
  };
  for (std::size_t from = 0; from < windows_.size();) {
    std::size_t to = from + 1;
    while (turns(from) && to < windows_.size() && goes_on(from, to)) ++to;
    const double against = against_in_percent(from, to);
    most = std::max(most, against);
    with = std::max(with, -against);
    from = to;
  }
  return with < kSlipAgainst_percent ? most : 0.0;
}

// Friction as read where the belt does not slip.
void Across::carried() {
  std::vector<double> friction, slipping;
  for (const Window& window : windows_) {
    if (!std::isfinite(window.mu_star) || !(std::abs(window[torque_role()]) > kTorqueTold_Nm))
      continue;
    friction.push_back(window.mu_star);
    if (window.slip_percent > kSlips_percent) slipping.push_back(window.mu_star);
  }
  if (friction.size() < kWindowsLeast) return;
  const double high = quantile(friction, 1.0 - kCarriedShare);
  const double most = config_.friction_is_assumed ? estimator::kMuReadMost : estimator::kMuMost;
  const std::string text = format(
      "the belt is read as carrying a friction of %.3g at an end stop; belts have %.2f to "
      "%.2f",
      high, estimator::kBeltLeast, estimator::kBeltMost);
  const std::string causes =
      ": unit of pressure (kPa for bar?) or torque, another pressure, piston area or radius" +
      swapped_too();
  if (high > most) {
    wrong(text + causes);
  } else if (high > estimator::kBeltMost) {
    doubt(text + causes);
  } else if (high < kCarriedLeast) {
    doubt(
        format("the belt is read as carrying a friction of %.2g at an end stop, never more: the "
               "clamp force would be %.0f times what it needs: unit of pressure (MPa for bar?) "
               "or torque, piston area",
               high, estimator::kBeltLeast / high));
  } else if (slipping.size() >= kWindowsLeast &&
             quantile(slipping, 1.0 - kCarriedShare) < estimator::kMuLeast) {
    doubt(
        format("the belt slips by %.0f %% and more where it is read as carrying a friction of %.3g "
               "at most; belts have %.2f to %.2f: torque in percent or another unit, another "
               "pressure, piston area or radius",
               kSlips_percent, quantile(slipping, 1.0 - kCarriedShare), estimator::kBeltLeast,
               estimator::kBeltMost) +
        swapped_too() + "?");
  }
}

// The force at the wheels, T omega_p / v, over what the car gains of speed. Noise of either makes
// one of the two lines flatter and the other steeper: the mass lies between them.
void Across::mass() {
  std::vector<double> force_N, gain_m_s2;
  for (const Window& window : windows_) {
    const double speed_m_s = window[Role::kVehicleSpeed], secondary = window[Role::kSecondarySpeed];
    const double torque_Nm = window[torque_role()], primary = window[Role::kPrimarySpeed];
    if (!(speed_m_s > 0.0) || !(secondary > kMoving_rad_s) || !(primary > kMoving_rad_s)) continue;
    if (!std::isfinite(torque_Nm)) continue;
    const bool braked = window[Role::kBrakePressed] > 0.0 ||
                        (!is_bound(Role::kBrakePressed) && torque_Nm < kTorqueSigned_Nm);
    if (braked || window[Role::kLockupClosed] < 1.0) continue;
    force_N.push_back(torque_Nm * primary / speed_m_s);
    gain_m_s2.push_back(speed_m_s / secondary * window.rate(Role::kSecondarySpeed));
  }
  if (force_N.size() < kMassWindows || deviation(gain_m_s2) < kAccelerationSpread_m_s2) return;
  const double together = correlation(gain_m_s2, force_N);
  if (together < kCorrelationSure) return;
  const double steep_kg = deviation(force_N) / deviation(gain_m_s2) / together;
  const double flat_kg = steep_kg * together * together;
  const std::string name(daemon::role_name(torque_role()));
  if (steep_kg < kMassLeast_kg) {
    doubt(name + format(" would move a car of %.0f to %.0f kg as this one moves: percent of a "
                        "reference torque, or scale?",
                        flat_kg, steep_kg));
  } else if (flat_kg > kMassMost_kg) {
    doubt(name + format(" would move %.0f kg and more as this car moves: unit or scale?", flat_kg));
  }
}

// At equal torque the secondary's pressure falls toward overdrive, as the belt runs farther out on
// the primary; the primary's rises.
void Across::pressure_course() {
  std::vector<std::array<double, 3>> rows;  // log ratio, torque, log pressure
  for (const Window& window : windows_) {
    const double primary = window[Role::kPrimarySpeed], secondary = window[Role::kSecondarySpeed];
    const double pressure = window[Role::kSecondaryPressure], torque = window[torque_role()];
    if (!(primary > kMoving_rad_s) || !(secondary > kMoving_rad_s) || !(pressure > 0.0)) continue;
    if (!(std::abs(torque) > kTorqueTold_Nm)) continue;
    rows.push_back({std::log(secondary / primary), std::log(std::abs(torque)), std::log(pressure)});
  }
  if (rows.size() < 8 * kWindowsLeast) return;
  const auto n = static_cast<double>(rows.size());
  std::array<double, 3> mean{};
  for (const auto& row : rows) {
    for (std::size_t k = 0; k < 3; ++k) mean[k] += row[k] / n;
  }
  double rr = 0.0, tt = 0.0, rt = 0.0, rp = 0.0, tp = 0.0, pp = 0.0;
  for (const auto& row : rows) {
    const double r = row[0] - mean[0], t = row[1] - mean[1], p = row[2] - mean[2];
    rr += r * r / n, tt += t * t / n, rt += r * t / n;
    rp += r * p / n, tp += t * p / n, pp += p * p / n;
  }
  const double determinant = rr * tt - rt * rt;
  if (std::sqrt(rr) < kRatioSpread || determinant < kApartLeast * rr * tt) return;
  const double by_ratio = (rp * tt - tp * rt) / determinant;
  const double by_torque = (tp * rr - rp * rt) / determinant;
  const double rest = pp - by_ratio * rp - by_torque * tp;
  const double explained = pp > 0.0 ? 1.0 - rest / pp : 0.0;
  if (by_ratio > kPressureRises && explained > kCorrelationSure * kCorrelationSure) {
    doubt(format("secondary_pressure rises toward overdrive at equal torque (as ratio to the power "
                 "%.2f); there it falls: primary for secondary pressure",
                 by_ratio) +
          swapped_too() + "?");
  } else if (by_torque < -kPressureRises && explained > kCorrelationSure * kCorrelationSure) {
    doubt(
        format("secondary_pressure falls where torque rises (as torque to the power %.2f): "
               "another pressure?",
               by_torque));
  }
}

void Across::pressure_command() {
  std::vector<double> share;
  for (const Window& window : windows_) {
    const double is = window[Role::kSecondaryPressure],
                 wanted = window[Role::kSecondaryPressureCommand];
    if (is > 0.0 && wanted > 0.0) share.push_back(is / wanted);
  }
  if (share.size() < kWindowsLeast) return;
  const double usual = quantile(share, 0.5);
  if (usual > kCommandFactor || usual < 1.0 / kCommandFactor) {
    doubt(format("secondary_pressure is %.3g times its command: a unit, or another pressure?",
                 usual));
  }
}

}  // namespace

Findings judge_across(const std::vector<Window>& windows, const daemon::Config& config) {
  return Across(windows, config).run();
}

}  // namespace beltgrip::check
