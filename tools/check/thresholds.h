// Every number that decides what `beltgrip check` says: value, unit in the name, origin. "derived"
// says from what, "measured" where, "chosen" why. Tools only.
#pragma once

#include <cstddef>
#include <cstdint>

namespace beltgrip::check {

// --- frames -------------------------------------------------------------------------------------
// Derived: a CRC of the wrong data id fits one frame in 256 by chance.
inline constexpr double kCrcWrongShare = 0.5;
// Derived: where each frame is there twice the counter stands still in half of them; a frozen
// sender that recovers does in few. A fifth less or more is as far from both.
inline constexpr double kStillWrongShare = 1.0 / 3.0;
// Chosen: an id of another car lies close by when it differs by a few in its last digits.
inline constexpr unsigned kSimilarIdDistance = 0x10;
inline constexpr int kSimilarShown = 3;
// Derived: as daemon/core/input/frame_guard.h judges a rate.
inline constexpr double kRateSlow = 1.0 / 1.75, kRateFast = 1.0 / 0.65;
// Derived: as the daemon's inputs grow stale (interfaces: 50 ms, or 2.5 periods).
inline constexpr double kGapLeast_s = 0.05, kGapPeriods = 2.5;
// Chosen: from here on gaps are told of as coming at regular times; scatter by their median.
inline constexpr int kRegularGaps = 3;
inline constexpr double kRegularScatter = 0.1;
// Chosen: nodes of one bus wake and fall asleep within a second or two of each other.
inline constexpr double kSilentLeast_s = 3.0, kSilentPeriods = 20.0;
// Derived: the sampler waits for at most 50 ms (daemon/core/input/sampler.h), of a slower signal
// the slope is followed.
inline constexpr double kRateLeast_Hz = 10.0;
// Chosen: a sender's clock and the pauses of a log make its rate in the mean come out lower.
inline constexpr double kRateMeasured = 0.95;

// --- values of one role -------------------------------------------------------------------------
// Chosen: a few values at the edge of the range are the signal's "not available" at start-up.
inline constexpr double kInRangeLeast = 0.99;
// Chosen: the shares of the values below which lie what counts as the least and the most; a few
// wild ones do not.
inline constexpr double kNearlyLeast = 0.01, kNearlyMost = 0.99;
// Chosen: no engine of a passenger car turns faster, no secondary pulley at 250 km/h either
// (variator-facts: some 48 1/min a km/h).
inline constexpr double kPrimaryMost_rad_s = 1050.0, kSecondaryMost_rad_s = 1700.0;
// Chosen: below 525 1/min no engine with a closed lock-up clutch runs.
inline constexpr double kPrimaryLeast_rad_s = 55.0;
// Derived: the windows of production sensors end at 9.6 MPa (variator-facts 2.2, K31x).
inline constexpr double kPressureMost_Pa = 10e6;
// Derived: no pump idles its secondary pulley below 0.1 MPa in drive; 20 kPa leaves room for a
// bench (variator-facts 2.2: 0.1 to 0.65 MPa at idle).
inline constexpr double kPressureLeast_Pa = 10e3;
inline constexpr double kPressureUsual_Pa = 100e3;
inline constexpr double kTorqueMost_Nm = 1000.0;
// Chosen: three times as much, for the ratio of low gear.
inline constexpr double kTorqueMostSecondary_Nm = 3000.0;
// Chosen: by so much a pedal's ends may be set up wrongly.
inline constexpr double kPedalBeyond = 0.05;
// Derived: 1 %, which a pedal never exceeds that says 0 to 1 and is read as percent; with rounding.
inline constexpr double kPedalAsShare = 0.0101;
// Derived: ends of the ranges of torque in percent, from one byte (0.390625 or 0.4 % a bit, half a
// percent with an offset, -125 to 130 of J1939); no engine's torque in Nm is coded to end there.
inline constexpr double kPercentTops[] = {99.609375, 100.0, 102.0, 125.0, 127.5, 130.0};
inline constexpr double kPercentBottoms[] = {-130.0, -127.5, -125.0, -102.0, -100.0, -25.0, 0.0};
// Chosen: the lightest car with a CVT weighs 650 kg, its driver and what turns with it 100 more.
// Measured (city, 1340 to 1420 kg by its two lines): a torque in percent of 205 Nm and more is
// named. Above: a loaded van of 3 t, twice.
inline constexpr double kMassLeast_kg = 700.0, kMassMost_kg = 6000.0;
// Chosen: of that a drive tells something when it gains and loses speed in so many windows.
inline constexpr std::size_t kMassWindows = 60;
inline constexpr double kAccelerationSpread_m_s2 = 0.2;
inline constexpr double kSpeedMost_m_s = 90.0;
inline constexpr double kOilLeast_degC = -50.0, kOilMost_degC = 170.0;
// Derived: 32 1/min a bit opens the paper's gate for good, 3 1/min do not (variator-facts 1.4).
inline constexpr double kSpeedStepMost_rad_s = 1.0;
// Chosen: a few hundred newtons of clamp force, a third of it in a coast-down.
inline constexpr double kPressureStepMost_Pa = 30e3;
// Chosen: no sensor of a shaft that changes its speed repeats a value for so long.
inline constexpr double kStuck_s = 0.5;
// Derived: while the other pulley moved by this the ratio would have left its end stop's band; the
// way that slip goes, which a bench's motor may show at a constant speed, only by kSlipBand.
inline constexpr double kOtherMoved = 0.03;
// Derived: noise of one step repeats a value in 29 of 100 frames at most, twenty times running in
// none of a long drive (1 / (2 sqrt(pi)), to the twentieth: 1e-11).
inline constexpr double kNoisySteps = 1.0;
// Chosen: where it stood for longer than it was noisy, that noise may be that of another state of a
// bench; three steps repeat a value in one frame of ten.
inline constexpr double kNoisyStepsSeldom = 3.0;
inline constexpr std::uint64_t kRepeats = 20;
// Chosen: a shaft that stood and then moves by so many of its usual largest moves (and steps) in
// one frame was not read meanwhile. Measured (130 foreign recordings, all shipped drives): 2 at
// most.
inline constexpr double kLeap = 5.0, kUsualMoves = 0.99;
// Chosen: a signal that never changed in so long is named.
inline constexpr double kConstantFor_s = 20.0;

// --- across roles, on windows of half a second --------------------------------------------------
inline constexpr double kWindow_s = 0.5;
inline constexpr std::size_t kWindowsLeast = 6;
// Derived: deformation, wear and what a drive slips for most of it move the ratio by less beyond
// its end stops.
inline constexpr double kStopBand = 0.04;
// Derived: the 10 % of slip that an experiment may come to (daemon/core/base/limits.h) lift the
// ratio by 11 % in overrun, and its overshoot by one more. In LOW some 45 kN bend the pulleys by 8
// %.
inline constexpr double kSlipBand = 0.12;
// Measured (city): 2 % of the windows, at walking speed, lie beyond the stops of a healthy car.
inline constexpr double kInStopsLeast = 0.95, kExplains = 0.95;
// Chosen: a car stays at an end stop for long, and passes other ratios.
inline constexpr double kStaysLeast = 0.5, kPasses = 0.05;
// Chosen: an engine with a closed lock-up turns with the primary pulley to within noise and delay.
inline constexpr double kSameSpeed = 0.015;
// Chosen: of single windows, which a gear change or slow sampling blurs; nearly all within four
// times as much.
inline constexpr double kSameSpeedOnce = 4.0 * kSameSpeed, kOneShaftLeast = 0.8;
// Chosen: of the mean of a flag over a window: it was so for all of it.
inline constexpr double kFlagOn = 0.99, kFlagOff = 0.01;
// Measured (a real chain CVT, read every five seconds: spreads 0.34 and 1.46).
inline constexpr double kSteadier = 3.0;
inline constexpr double kGearMost =
    0.4;  // chosen: of a gear before the pulley, in either direction
// Measured (city, both ways round): the spread of vehicle speed over the pulley that drives the
// wheels is 2 %, over the other it is what the ratio moved by.
inline constexpr double kFinalDriveSpread = 0.06, kOtherSpread = 0.20;
// Derived: 0.30 m wheel radius over a final drive of 4 to 7: 0.043 to 0.075 m; doubled for trucks.
inline constexpr double kFinalDriveLeast_m = 0.02, kFinalDriveMost_m = 0.16;
inline constexpr double kPerMinute = 9.549296585513721;  // 1/min in a rad/s
// Chosen: below these a car stands.
inline constexpr double kStanding_rad_s = 5.0, kMoving_rad_s = 40.0;
inline constexpr double kStandsClosed_s = 2.0;
// Chosen: an open converter turns as one shaft now and then, at little torque, not nearly always.
inline constexpr double kMostly = 0.9;
// Measured (all shipped scenarios: +0.75 and more where torque moves by 15 Nm).
inline constexpr double kTorqueSpread_Nm = 10.0;
inline constexpr double kTorqueAgainst = -0.5;
inline constexpr double kPedalPressed = 0.15, kPedalReleased = 0.02;
inline constexpr double kTorqueSigned_Nm = 8.0;
// Chosen: 955 1/min; slower, idle control drives the car with the pedal released.
inline constexpr double kOverrunLeast_rad_s = 100.0;
// Chosen: with less the zero of the torque is a large share of it.
inline constexpr double kTorqueTold_Nm = 10.0;
// Chosen: cruise control lets go of the wheels once or twice, not a driver's many times.
inline constexpr int kTurnsOfTorque = 4;
// Derived: at the belt's best friction (0.15) a belt would slip; as read beyond it, a unit or a
// constant is wrong. estimator/method/possible_friction.h.
inline constexpr double kCarriedShare = 0.05;  // of the windows
// Chosen: an experiment lowers the clamp by as much and more; noise and steps of the torque do not
// make up a twentieth of the windows beyond it.
inline constexpr double kLoweredLeast = 1.25;
// Derived: the radii bend back by 1.8e-6 a newton, some kilonewtons, and an end stop is known to
// half a percent.
inline constexpr double kSlipAgainst_percent = 1.5;
// Chosen: speeds that a car or bench holds while its clamp is lowered and comes back; a ratio that
// is back at its stop has come within half of the slip that is told (in ln).
inline constexpr double kSteadySpeeds = 0.12;
inline constexpr double kBackAtStop = 0.0075;
// Derived: a stop that is known to half a percent and pulleys that bend by 2 % leave no such slip.
inline constexpr double kSlips_percent = 3.0;
// Chosen: half of what the highest known force floor leaves in a coast-down (7.6 kN at 33 Nm in
// overdrive: 0.027); a bar read as MPa gives a tenth of 0.03 to 0.1.
inline constexpr double kCarriedLeast = 0.015;
// Measured (city): secondary pressure at equal torque falls toward overdrive by -0.2 and less,
// primary pressure rises by +0.3 and more, in log(pressure) a log(ratio).
inline constexpr double kPressureRises = 0.15;
inline constexpr double kRatioSpread = 0.15;  // standard deviation of log(ratio), for that
inline constexpr double kCorrelationSure = 0.5;
// Chosen: ratio and torque tell apart while one explains no more than four fifths of the other.
inline constexpr double kApartLeast = 0.2;
// Chosen: a wrong unit is off by more (psi for kPa: 6.9 times), a regulator by less.
inline constexpr double kCommandFactor = 1.5;

// --- against what calibrate measures ------------------------------------------------------------
inline constexpr double kConstantDeviations = 3.0;
// Derived: a delay of the torque of 5 ms is within one sample; a ratio that is off by 1 % is half
// the slip at the peak; an inertia off by 15 % is some newton metres in a coast-down.
inline constexpr double kDelayTold_s = 5e-3;
inline constexpr double kDelayToldPeriods = 0.25;  // chosen: less is how a signal is sampled
inline constexpr double kRatioOff = 0.01, kInertiaOff = 0.15;
// Derived: 10 kPa are 113 N of clamp force, a twentieth of it in a coast-down.
inline constexpr double kZeroTold_Pa = 10e3;

// --- experiments --------------------------------------------------------------------------------
// Chosen: with more conditions missing the car was not about to coast as an experiment needs it.
inline constexpr int kNearMisses = 3;

}  // namespace beltgrip::check
