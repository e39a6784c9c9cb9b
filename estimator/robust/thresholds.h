// The constants by which the robust method decides. Each with its unit and its origin: derived
// (from what), measured (by which command) or chosen (why). What a fifth of each changes stands in
// estimator/ACCURACY.md. Sizes of tables, steps of grids and shares of work stand where they are
// used: they decide how finely, not what.
#pragma once

namespace beltgrip::estimator {

// Evidence, in standard deviations.
// Of one look. Chosen: chance alone shows it once in 700 looks.
inline constexpr double kEvident = 3.0;
// Of one of thousands of looks, which an experiment has. Derived: once in three million.
inline constexpr double kInManyLooks = 5.0;

// Maximum friction is the largest up to this slip, percent. Given: what a value is held against
// where friction rises on; no belt is driven further.
inline constexpr double kFrictionTo_percent = 10.0;
// Root mean square of the slope, as a share of mu per percent, by which friction that was not seen
// to turn down rises on beyond the data, whatever its slope at their end is. Measured on 4,800
// traces of other make (estimator/ACCURACY.md): values on 97.8 / 97.3 / 77.6 % of the peaks, lab /
// production / harsh, and 4.4 / 7.8 / 7.7 % of those where friction rises on miss; a fifth less
// 98.0 / 97.8 / 79.3 and 5.5 / 10.0 / 9.2 %; a fifth more 97.7 / 96.0 / 75.6 and 3.6 / 6.8 / 6.5 %.
inline constexpr double kUnseenRise = 0.007;

// When to stop (stop_detector).
// Elasticity, k s / mu, below which a curve counts as level. Derived: curves that saturate are
// within half a percent of their top by then.
inline constexpr double kLevelElasticity = 0.03;
// Percent: slip that elasticity is taken at, at least. Chosen: below it noise and seat are slip.
inline constexpr double kLevelSlipLeast_percent = 0.5;
// Deviations of k that show it level: so many, more for each factor e by which the slope of a belt
// that holds lies above level, at most. Chosen: a small step from what is seen needs little.
inline constexpr double kLevelDeviations = 1.0;
inline constexpr double kLevelDeviationsPerE = 0.8;
inline constexpr double kLevelDeviationsMost = 3.5;
// Percent of slip gained within a window from which on less will do, in proportion. Chosen.
inline constexpr double kLargeGain_percent = 0.4;
// Percent of slip gained before a window is looked at. Chosen: less is a seat that settles.
inline constexpr double kSmallestGain_percent = 0.2;
// Percent of slip by which a level curve is followed on, in search of its fall, and seconds of what
// it gains meanwhile. Chosen: the price of a value, in slip.
inline constexpr double kFollow_percent = 1.1;
inline constexpr double kAhead_s = 0.07;
// Percent of slip above the smallest, and that it comes to within so many seconds: ended without a
// slope. Chosen: inside what is promised of slip, and beyond the peaks of belts.
inline constexpr double kBackupSlip_percent = 7.5;
inline constexpr double kBackupAhead_percent = 9.0;
inline constexpr double kBackupAhead_s = 0.15;
// Seconds: no slope before. Chosen: the load is being taken up.
inline constexpr double kSettle_s = 1.2;

// Whether a reading is one (robust_estimator, force_step).
// A jump by more is looked at: of a speed and of the torque, relative. Chosen: no belt is as quick.
inline constexpr double kGlitchSlip_share = 0.005;
inline constexpr double kGlitchTorque = 0.2;
// Slip that grows though mu* climbed by less, of the first, and the force has not moved: a channel
// stands still. Chosen.
inline constexpr double kClimb = 1.05;
// Of the first force, and of mu long after the stop: what is left of one that has not moved.
// Chosen.
inline constexpr double kUnmoved = 0.99;
// Of the force: a step of the pressure's reading, at least; and one that no lag at the corner of a
// ramp makes. Chosen.
inline constexpr double kStepShare = 0.015;
inline constexpr double kLargeStepShare = 0.04;
// Of the ramp before it, to go on as a ramp. Chosen.
inline constexpr double kFallsOn = 0.5;
// Of what slip would have to move by, were the step true. Chosen.
inline constexpr double kSlipFollows = 0.4;
// Deviations that slip, and a slope, may be off by. Chosen.
inline constexpr double kSlipDeviations = 4.0;
inline constexpr double kSlopeDeviations = 2.0;
// Readings in each of its groups. Derived: a pressure between two readings is foretold by the line
// of the last four. Shorter groups hold errors of that line, which their neighbours share, and a
// mean's noise does not tell them. Measured on 40 ramps read every 100 ms (curve_health_test): in
// steps of 452 N a false step in 31 without it, 19 with two readings, 1 with four; steps of 25 % in
// a fine reading are found in 39 instead of 40. 500 recordings of other make are answered alike
// with 2, 3.2, 4 and 4.8.
inline constexpr double kReadings = 4.0;
// Steps of a signal that is rounded coarsely, of its rounding, are no steps. Chosen.
inline constexpr double kStairs = 1.5;

// What follows the stop (after_stop, follow_on).
// Seconds for which the belt is watched; a clamp that is given back ends it sooner. Chosen.
inline constexpr double kAfterStop_s = 0.5;
// Percent beyond the slip at the stop, where slip moves on too fast for channels that are read one
// after the other. Measured on 4,800 traces of other make: with 1.5 instead 2 % fewer values with
// harsh noise, as many else.
inline constexpr double kRunAway_percent = 2.0;
// Of slip that swung back, the percent it had gained, and the share of that which is left: a rattle
// and no friction. Chosen.
inline constexpr double kSwing_percent = 0.3;
inline constexpr double kSwingLeft = 0.4;
// Of the pace before the stop, the later one: a speed stood still. Chosen.
inline constexpr double kSlower = 2.0;

// What to expect before the peak has been seen (peak_forecast).
// Of mu_max per slip at the peak, beyond the peak of the forms. Chosen: most belts fall by less.
inline constexpr double kFallBeyond = 0.03;
// Percent of slip, one deviation: the end stop. Chosen.
inline constexpr double kEndStop_percent = 0.1;
// Of mu* at every point: no curve is exactly one of the forms. Chosen.
inline constexpr double kForecastFormError = 0.009;
// Neighbouring points share what is wrong with the form and with the line of the force: so much of
// their evidence is their own. Chosen.
inline constexpr double kOwnEvidence = 0.75;
// Deviations by which a mean of points surely was reached. Chosen: of some fifty means.
inline constexpr double kForecastReached = 2.7;
// Forecasts in a row that are narrow enough to stop. Chosen: one may be a matter of luck.
inline constexpr int kNarrowInARow = 4;

// The fit of the peak (peak_fit).
// Percent of slip, and seconds, that a point of the curve spans, at the least and at the most.
// Chosen: fine enough for a top of half a percent, coarse enough for the work.
inline constexpr double kPointSlip_percent = 0.04;
inline constexpr double kPointShortest_s = 0.02;
inline constexpr double kPointLongest_s = 1.0;
// Of the top of mu*: from where the forms are fitted. Chosen: below it other physics shape a curve.
// Where a backup stop ended it, a value needs a curve that was followed up from below. Chosen: one
// that begins nearer may have slipped over its top before. Measured (worn_belt_test): a worn belt
// that slips at once read 13 % too low without it, at 0.87 of its top.
inline constexpr double kTopFrom = 0.9;
// Of mu*: how well its course is to be known before it is followed. Chosen.
inline constexpr double kCoursePrecision = 0.02;
// Of the span of slip: the shortest scale of a form, and how far from the upper end a corner may
// lie. Chosen.
inline constexpr double kFirstLambda = 0.06;
inline constexpr double kCornersOver = 0.75;
// Of how far mu* lies below its top: forms are local. Chosen.
inline constexpr double kFormError = 0.05;
// Of mu: friction that is not quite one of the forms, as its residuals are tested. Chosen.
inline constexpr double kFormTolerance = 0.002;
// Of the fitted top: where its residuals are tested; of the top of mu*: where the chord is. Chosen.
inline constexpr double kNearTop = 0.98;
inline constexpr double kHealthFrom = 0.6;
// Of the clamp force: one that changed by less stood. Chosen.
inline constexpr double kStandsStill = 0.02;
// Deviations by which mu* surely was reached. Derived: the largest of many windows.
inline constexpr double kReachedDeviations = 3.3;

// The verdict (robust_estimator, curve_health).
// Probability that the data contain the peak, with another end than a stop by the slope. Chosen.
inline constexpr double kInsideWithoutStop = 0.9;
// Of mu: what the forms of the fit leave. Chosen.
inline constexpr double kFormDeviation = 5e-4;
// Deviations by which the fit's top is lowered for a bound. Chosen: more, for it leans on forms.
inline constexpr double kFittedDeviations = 2.6;
// Deviations beyond which points lie on no one curve: below a chord, of which there are many, and
// runs of one sign. Chosen.
inline constexpr double kChordDeviations = 5.5;
inline constexpr double kRuns = 4.5;
// Of mu: friction that is not quite a curve, in a chord. Chosen.
inline constexpr double kChordTolerance = 0.003;
// Percent: less slip at a contradictory top is that of a belt that grips. Chosen.
inline constexpr double kSlipOfATop_percent = 1.5;

}  // namespace beltgrip::estimator
