// What a cause may follow: variables that are recorded or known, none that the residual's own noise
// moves.
#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "tools/diagnose/infer/residuals.h"

namespace beltgrip::diagnose {

struct IndexVariable {
  const char* name;                                                    // the role, or what it is
  Eigen::ArrayXd (*value)(const ExperimentData& run, int experiment);  // empty: not recorded
  std::optional<estimator::LearnedVariable> learnable;
  std::string_view unit;  // of its values, where a function of it may be learned
};

std::span<const IndexVariable> index_variables();

// A variable over all experiments as the abscissa of a function: 0 to 1 between its 1 % and 99 %
// points. The mean of an experiment that hardly moves it, else low-passed: its own noise is no
// regressor.
struct Abscissa {
  const IndexVariable* variable = nullptr;
  double low = 0.0, high = 0.0;
  std::vector<Eigen::ArrayXd> x;  // per experiment, within 0 and 1; empty where nothing is valid
  std::vector<double> mean;       // per experiment, of the valid samples
  std::vector<int> level;         // per experiment: those of one level have about the same mean
  int levels = 0;
};
// None where it is not recorded in all experiments or does not vary.
std::optional<Abscissa> abscissa_of(const Campaign& campaign, const IndexVariable& variable);

}  // namespace beltgrip::diagnose
