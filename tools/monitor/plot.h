// mu* over sigma* as lines of characters: a mark for each phase, the band of mu_max across. Pure.
// Tools only.
#pragma once

#include <string>
#include <vector>

#include "tools/monitor/view.h"

namespace beltgrip::monitor {

inline constexpr std::size_t kPhaseMarks = 4;
// By estimator::Phase; a later phase covers an earlier one.
inline constexpr char kPhaseMark[kPhaseMarks] = {'.', 'o', '^', 'x'};

// Exactly `rows` lines of at most `columns` characters, axes and their numbers included. Without a
// point and without a value, or too small for a curve: blank lines.
std::vector<std::string> plot(const std::vector<CurvePoint>& points, const Friction& friction,
                              int columns, int rows);

}  // namespace beltgrip::monitor
