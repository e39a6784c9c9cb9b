// How the friction curves of pushbelts differ from the nominal one: together along the slip, not at
// each knot for itself. A foot that is flat or bent the wrong way is no belt's, but what an error
// of the ratio would look like.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "tools/diagnose/model/variator_model.h"

namespace beltgrip::diagnose {

using KnotMatrix = Eigen::Matrix<double, kShapeKnots, kShapeKnots>;

// Departures of the usual curve, at the knots.
const Eigen::Matrix<double, kShapeKnots, 1>& usual_departure();
// One column per mode, about the usual curve, the largest first: the departures at the knots,
// shares of mu_max, of one sigma of that mode. Modes are independent of each other.
const KnotMatrix& curve_modes();
// Differences at the knots to sizes of the modes, in sigmas.
const KnotMatrix& curve_modes_inverse();
// The departure of one sigma of a mode.
const CurveShape& mode_shape(int mode);
// The cubics of all modes side by side, by interval of SplinePosition and power of its u. The last
// ones are zero: whole registers of modes.
inline constexpr std::size_t kModesAbreast = 16;
static_assert(kModesAbreast >= kShapeKnots);
using ModeCubics = std::array<std::array<std::array<double, kModesAbreast>, 4>, kShapeKnots + 1>;
const ModeCubics& mode_cubics();

// What no friction does: by how much the slope of a curve grows from one interval between its knots
// to the next on the way to the peak, and its derivatives by the modes.
struct CurveFault {
  double slope = 0.0;  // of mu over mu_max, per slip at the peak
  Eigen::Matrix<double, kShapeKnots, 1> by_mode;
};
std::vector<CurveFault> curve_faults(std::span<const double, kShapeKnots> departure);

// Of the curve that a parameter of the machine is a mode of; -1: it is none.
int first_knot(int parameter);

}  // namespace beltgrip::diagnose
