// The experiments of a log as a page to look at: results in a table, and for each experiment its
// traction curve beside its course over time (the paper's Figures 7 and 6). Tools only.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "tools/report/html_page.h"

namespace beltgrip::report {

inline constexpr std::size_t kPhaseCount = 4;

struct ExperimentCourse {
  std::string name;                  // of its heading
  std::vector<std::string> verdict;  // a cell for each of kVerdictHeader
  // One entry a sample; all of one length.
  std::vector<double> t_s, mu_star, sigma_star_percent, slip_variance, friction_slope_per_percent,
      clamp_force_N;
  std::vector<std::size_t> phase;  // 0 .. kPhaseCount - 1
  double period_s = 0.0;           // of the samples
  std::optional<double> stop_s;
  struct Peak {
    double mu_max, low, high;  // and the 95 % interval
  };
  std::optional<Peak> peak;  // where there is a value
};
inline const std::vector<std::string> kVerdictHeader{"experiment",
                                                     "outcome",
                                                     "why it ended",
                                                     "torque",
                                                     "ratio",
                                                     "mu_max",
                                                     "95 % interval",
                                                     "slip at the stop, %",
                                                     "slip at the peak, %",
                                                     "slip up to, %",
                                                     "slip energy, before the peak too, J",
                                                     "slip path, m"};

// Of the paper's phases; method "robust" has none.
struct PhaseThresholds {
  double excitation = 0.0;                    // of the slip variance
  double stop_slope = 0.0, peak_slope = 0.0;  // 1 / percent slip
};

void add_experiments(HtmlPage& page, const std::vector<ExperimentCourse>& experiments,
                     const std::array<std::string, kPhaseCount>& phase_names,
                     const std::optional<PhaseThresholds>& thresholds);

}  // namespace beltgrip::report
