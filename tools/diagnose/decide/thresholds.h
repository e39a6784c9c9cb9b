// What decides whether residuals pass: each number with its unit and where it comes from.
#pragma once

namespace beltgrip::diagnose::thresholds {

// Twice the log evidence of a step, kink or bump over nothing. Above the largest of 55 healthy
// campaigns with varied plans (30; equal plans reach 103, which no limit here can mend).
inline constexpr double kLawCell = 35.0;
// A law counts where a smooth function explains so much at least: a step of one moment is no cause.
inline constexpr double kSmoothBeside = 10.0;
// The same of a smooth function: the largest of those was 30.
inline constexpr double kSmoothCell = 35.0;
// Times both limits where channels move in steps beyond their noise.
inline constexpr double kCoarse = 5.0;
// Of the best cell, where the scatter between experiments is more than it should be.
inline constexpr double kCellBesideScatter = 9.0;
// The order of the experiments is scatter by another name: it has to beat all others by so much.
inline constexpr double kOrderAhead = 10.0;
// The strongest line of the residuals, in sigmas of the pooled spectrum.
inline constexpr double kLine = 5.5;
// Of the residual's fast power: what is a line and not the trace of a function that sweeps.
inline constexpr double kLineShare = 0.2;
// Common p-value of the residuals' autocorrelation.
inline constexpr double kWhiteness = 1e-9;
// Scatter between experiments over its base, standard deviations.
inline constexpr double kScatterFriction = 2.2;
inline constexpr double kScatterRatio = 3.3;
inline constexpr double kScatterTorque = 2.2;
// The same over what rigs usually scatter by, however much replicates do.
inline constexpr double kUnusualScatter = 4.0;

}  // namespace beltgrip::diagnose::thresholds
