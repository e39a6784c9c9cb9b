// What decides whether residuals pass: each number with its unit and where it comes from.
#pragma once

#include <cstddef>

namespace beltgrip::diagnose::thresholds {

// Twice the log evidence of a step, kink or bump over nothing. Above the largest of 55 healthy
// campaigns with varied plans (30; equal plans reach 103, which no limit here can mend).
inline constexpr double kLawCell = 35.0;
// A law counts where a smooth function explains so much at least: a step of one moment is no cause.
inline constexpr double kSmoothBeside = 10.0;
// The same of a smooth function: the largest of those was 30.
inline constexpr double kSmoothCell = 35.0;
// Of the cell that explains most, a law or a smooth function, where it is friction, ratio or clamp
// force and over neither time nor acceleration: there no dynamics that the model lacks stand.
// Measured: 10 at most in 152 healthy campaigns of the blind test's generator (102 with varied
// plans, 50 with equal ones); in 61 of other make 24 and 19, the next 15; in three unknown causes
// that nothing else finds 24 to 28. A fifth less: one healthy one more; a fifth more: one of the
// three less, and the healthy one.
inline constexpr double kHeldCell = 20.0;
// Of a cell over the variable that a named effect follows, beside that effect: odds of 20 to 1. The
// largest beside the right names of 20 campaigns of other make is 1.3.
inline constexpr double kOwnShape = 6.0;
// Of the best cell, where the scatter between experiments is more than it should be.
inline constexpr double kCellBesideScatter = 9.0;
// By how much neighbours along it are more alike than in a scatter, sigmas of von Neumann's ratio.
// Chosen: one of 160 by chance. Where nothing is followed 1.6 at most (three campaigns of eight to
// thirteen experiments), so that a fifth either way is the same.
inline constexpr double kAlikeSigmas = 2.5;
// The order of the experiments is scatter by another name: it has to beat all others by so much.
inline constexpr double kOrderAhead = 10.0;
// The strongest line of the residuals, in sigmas of the pooled spectrum.
inline constexpr double kLine = 5.5;
// The line at the belt's passage, in sigmas. That of a ripple once per revolution: sums of
// exponential variables have heavier tails than the normal.
inline constexpr double kBeltLine = 6.5;
// A line below those, in sigmas of what the frequencies about it have. Measured in campaigns of
// other make whose readings are fine: 5.0 at most in 268 healthy ones, the next 4.2; 8.1 to 29 in
// nine whose force or ratio swings at 0.3 to 0.7 Hz. A fifth less and one healthy one is at it; a
// fifth more lies between.
inline constexpr double kSlowLine = 6.5;
// A line in a channel's own samples, power over the level about it.
inline constexpr double kChannelLine = 10.0;
// A hump in the spectrum of the torque that does not arrive behind the belt, sigmas: a shaft that
// swings. Measured in 370 campaigns of other make: 2.5 at most in 148 healthy ones, 3.3 in all that
// do not swing, 5.6 to 39 in four of five that do with both torques read (the fifth swings at 1.6
// Hz, beside what drives the machine). A fifth less: the same; a fifth more: one of the four less.
inline constexpr double kSwing = 5.0;
// The same of the slip, where one speed swings alone. Measured: 2.0 at most in 99 healthy or
// rippled campaigns of the blind test's generator, 3.2 in 58 of other make that do not swing, 9.8
// and 119 in two whose reading of one speed does. A fifth less or more: the same.
inline constexpr double kSlipSwing = 5.0;
// Of the residual's fast power: what is a line and not the trace of a function that sweeps.
inline constexpr double kLineShare = 0.2;
// Common p-value of the residuals' autocorrelation.
inline constexpr double kWhiteness = 1e-9;
// Of residuals that wander within experiments, rms, in what healthy ones differ by from each other:
// less is what sensors do. Between 0.6, the most of healthy ones (200 of other make, 0.32 in 100 of
// the blind test's), and 1.0, the least that is there (a ratio that creeps; 1.1 to 3 where a delay
// or a zero drifts).
inline constexpr double kWander = 0.7;
// Scatter between experiments over that of replicates, standard deviations, where many tell it.
inline constexpr double kScatterFriction = 2.2;
inline constexpr double kScatterRatio = 3.3;
inline constexpr double kScatterTorque = 2.2;
// Chance that a healthy machine's is above the limit where few replicates tell the base, and few
// experiments the scatter. Chosen: a thousandth of each test.
inline constexpr double kScatterChance = 1e-3;
// The same over what rigs usually scatter by, however much replicates do.
inline constexpr double kUnusualScatter = 4.0;
// What healthy machines differ by, in usual scatters; how well so many experiments tell it comes on
// top (scatter_limit). Of the friction, 1 %: healthy machines of five generators of other make draw
// 0.3 to 1 %, and less is of no consequence. Of the ratio: belts seat anew by up to 0.05 %. Of the
// torque's zero: as before at a dozen experiments, 2.2.
inline constexpr double kUsualMostFriction = 2.5;
inline constexpr double kUsualMostRatio = 3.3;
inline constexpr double kUsualMostTorque = 1.55;
// Derived: sigmas of the estimate of a standard deviation that the limits leave.
inline constexpr double kScatterSigmas = 2.0;

// A function is learned where its variable was set at so many levels: the two outer ones lie
// outside what the others cover, and three inner ones can be left out in turn.
inline constexpr int kLevelsMin = 5;
// Of the excess of each test that failed, at least, is gone with the function in the model: what is
// static loses nearly all, a ripple or a resonance that happens to have a cell a few percent.
inline constexpr double kHealed = 0.6;
// Chosen, of a limit: a test that fails by less is not counted as failed by less.
inline constexpr double kTrifle = 0.25;
// Log predictive density of the levels left out, nats: odds of 20 to 1.
inline constexpr double kLeftOutLevels = 3.0;
// Nats within which two explanations are the same: odds of 20 to 1.
inline constexpr double kSameNats = 3.0;
// Nats by which a law may predict levels left out worse than the free function and still be named.
inline constexpr double kLawWorse = 1.0;
// Of the best cell's gain: what explains less is the shadow of that.
inline constexpr double kNearBest = 0.5;
// Chosen: of more functions than these no campaign of a dozen experiments tells; tried at most, for
// each.
inline constexpr std::size_t kTermsMax = 2, kTermsTried = 3;
// Chosen: an error of mu_max that is none. A fifth less and a function of the tenth's 286 that is
// right is lost (0.0042 to 0.0048), a fifth more the same.
inline constexpr double kMuMaxTrifle = 0.005;
// No machine is off by more: Nm, share, N, share, share; the bounds of the effects that act there.
inline constexpr double kLearnedBound[] = {20.0, 0.25, 3000.0, 0.08, 0.6};

}  // namespace beltgrip::diagnose::thresholds
