// What many experiments say together of one belt: the friction now, with drift from experiment to
// experiment; whether it has fallen for good; and whether results contradict each other. Pure
// functions on rows in the order in which they were made; fixed memory, any thread but not made for
// the real-time one (some 10^5 operations).
//
// Directions and end stops are kept apart: losses raise mu* in drive and lower it in overrun, and
// friction differs between the end stops.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "estimator/belt/belt_memory.h"
#include "estimator/method/slip_curve_estimator.h"

namespace beltgrip::estimator {

struct BeltExperiment {
  double time_s = 0.0;  // Unix time
  PeakKind kind = PeakKind::kNone;
  double mu_max = 0.0;  // value or lower bound
  double mu_max_std = 0.0;
  double ci95_low = 0.0;
  double ci95_high = 0.0;
  // The part of the interval that is the same in every experiment: errors of the sensors, constants
  // that are assumed.
  double sensor_std = 0.0;
  Direction direction = Direction::kDrive;
  EndStop end_stop = EndStop::kOverdrive;
  double omega_p_rad_s = 0.0;
  double torque_Nm = 0.0;  // signed
  double oil_degC = std::numeric_limits<double>::quiet_NaN();
  // Torque by clamp force as its request was ended, as read; 0: not known.
  double carried_Nm_per_N = 0.0;
  bool slipped = false;  // with less friction than was known, and gave no value
};

struct FusedFriction {
  bool known = false;
  double mu_max = 0.0;  // at 80 degC, or as it came where the oil's temperature is not known
  double mu_max_std = 0.0;
  double ci95_low = 0.0;
  double ci95_high = 0.0;
  double repeatability_percent = 0.0;  // scatter between experiments beyond what each one states
  double drift_percent = 0.0;          // trend of the last kWindow, per experiment
  double drift_percent_std = 0.0;      // 0: fewer than five experiments
  double torque_Nm = 0.0;              // mean magnitude
  int experiments = 0;                 // looked at
  int weighed = 0;                     // of them: on which mu_max rests
  bool last_waits = false;             // more than four deviations off: for a second on its side
};

struct LearnedFriction {
  std::array<FusedFriction, kBeltGroups> groups{};
  BeltMemory memory;       // of the same experiments
  bool doubtful = false;   // the last result contradicts the others
  bool unwritten = false;  // the history is not kept as it should be
  static constexpr std::size_t index(Direction direction, EndStop end_stop) noexcept {
    return belt_group(direction, end_stop);
  }
  const FusedFriction& of(Direction direction, EndStop end_stop) const noexcept {
    return groups[index(direction, end_stop)];
  }
};

// The model: ln(mu_i) = level_i + a (oil - 80 degC) + e_i. The level walks at random, by q per
// experiment and by 5 % in the square root of a year; e_i has the variance that the experiment
// states and tau^2 on top. q and tau are not tuned: the answer is the average over a grid of both,
// weighted by how well each foresaw every next experiment. A result more than four deviations off
// its prediction waits for a second one on its side; then the level starts anew from both. Constant
// errors of the sensors, which no number of experiments averages out, are added at the end.
inline constexpr std::size_t kWindow = 64;  // experiments looked at

struct Innovations {  // of the last kWindow, in order; in standard deviations of the prediction
  std::array<double, kWindow> value{};
  std::size_t count = 0;
  std::span<const double> span() const { return {value.data(), count}; }
};

// now_s: Unix time; knowledge ages. A history whose last row lies in the future by more than a day
// has an age that nobody knows: its spread is that of an unknown belt.
FusedFriction fuse(std::span<const BeltExperiment> experiments, Direction direction,
                   EndStop end_stop, double now_s, Innovations* innovations = nullptr);
void remember(const BeltExperiment& each, BeltMemory& memory);
LearnedFriction learn(std::span<const BeltExperiment> experiments, double now_s);

// Wear: the last five experiments of a group against earlier ones under equal conditions (oil
// within 10 K, torque and speed within 20 % of the mean of the five), at least five, at most
// kBeforeMax. Student's test with the scatter that the experiments show, not the one that they
// state: exact whatever their own standard deviations are worth. One-sided, 1 % false alarms each
// time it is asked.
inline constexpr std::size_t kWearAfter = 5;
inline constexpr std::size_t kWearBeforeMin = 5;
inline constexpr std::size_t kBeforeMax = 32;
inline constexpr double kWearFalseAlarm = 0.01;

struct WearTest {
  bool judged = false;
  bool found = false;           // the friction has fallen
  double change_percent = 0.0;  // < 0: fallen
  double ci95_low = 0.0;
  double ci95_high = 0.0;
  double p_value = 1.0;
  int before = 0;
  int after = 0;
};
// Where friction fell: of all ways to part the last kBeforeMax + kWearAfter experiments of a group,
// under the conditions of the last five, in those before and those after, two at least on either
// side, the one that Student's test finds least like chance. The p-value counts how many ways were
// tried. Found below kStepFalseAlarm: it is asked beside `wear`, which keeps its own 1 %.
inline constexpr double kStepFalseAlarm = 0.002;
struct WearStep {
  WearTest test;          // of that way
  std::size_t first = 0;  // after it, in `experiments`
};
WearStep wear_step(std::span<const BeltExperiment> experiments, Direction direction,
                   EndStop end_stop);
// ln(mu_max) of both sides; at least two values each.
WearTest compare(std::span<const double> before, std::span<const double> after);
WearTest wear(std::span<const BeltExperiment> experiments, Direction direction, EndStop end_stop);

// What is noted beside a result; one bit each, as in the history.
enum class Note : std::uint8_t {
  kOutlier,        // more than four deviations from what the results before it let expect
  kTrend,          // the last eight or more results lie on one side of their predictions
  kWear,           // see above
  kDirections,     // drive and overrun differ by more than a loss of 0 to 5 Nm explains
  kEndStops,       // LOW and overdrive differ by more than 0.9 to 1.15
  kContradictory,  // its own points lie on no one friction curve: PeakEstimate.contradictory
  kSlipped         // the belt slipped with less friction than was known, and gave no value
};
inline constexpr std::size_t kNoteCount = 7;
constexpr std::uint32_t note_bit(Note note) { return 1U << static_cast<unsigned>(note); }
// These make a result doubtful; the others are results themselves.
inline constexpr std::uint32_t kDoubts = note_bit(Note::kOutlier) | note_bit(Note::kDirections) |
                                         note_bit(Note::kEndStops) |
                                         note_bit(Note::kContradictory) | note_bit(Note::kSlipped);

// Notes on the last of the experiments. Innovations, sign runs, wear: of its group; directions and
// end stops: among the groups that it belongs to.
std::uint32_t notes_on_last(std::span<const BeltExperiment> experiments, double now_s);

}  // namespace beltgrip::estimator
