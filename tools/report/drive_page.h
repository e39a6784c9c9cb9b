// A drive as a timeline: what the belt carried, what it was asked for, when something stood in the
// way of an experiment, and what it went through. Tools only.
#pragma once

#include <string>
#include <vector>

#include "tools/report/html_page.h"

namespace beltgrip::report {

struct Wear {  // of the belt, by slip
  double known_s = 0.0, energy_J = 0.0, path_m = 0.0, slip_most_percent = 0.0;
};

struct Drive {
  std::string name;  // of its heading
  // One entry a sample; all of one length.
  std::vector<double> t_s, primary_speed_rad_s, secondary_speed_rad_s, torque_Nm, belt_torque_Nm,
      clamp_force_N, asked_force_N, sigma_star_percent, mu_star, mu_max, slip_energy_J;
  double period_s = 0.0;
  std::vector<Lane> lanes;  // what stood, and when
  std::vector<Mark> results;
  std::vector<Interval> experiments_s;
  Wear whole, in_experiments;
  std::vector<std::vector<std::string>> reasons;  // a cell for each of kReasonHeader
};
inline const std::vector<std::string> kReasonHeader{
    "what stood", "for, s", "times", "with no pedal pressed, s", "means", "figure", "to do"};

void add_drive(HtmlPage& page, Drive drive);

}  // namespace beltgrip::report
