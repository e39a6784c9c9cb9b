#include "tools/diagnose/decide/plausibility.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "estimator/physics/clamp_force.h"
#include "estimator/statistics/order.h"
#include "tools/diagnose/data/text_of.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kSameRatio = 1.03;          // of two experiments at one end stop, most
constexpr double kSoftestPerkN = 0.01;       // deformation of pulleys per clamp force, most
constexpr double kMuMost = 0.4;              // friction of any belt, and more
constexpr double kMuLeast = 0.03;            // the same, and less
constexpr double kPeakSlipMost_share = 0.1;  // slip at its peak, and more
constexpr double kPressureMost_Pa = 200e5;   // three times what variators have
// Less may be losses and zero errors alone, of one torque as of what is between two. A fifth less
// or more: the same in 340 campaigns of other make, where they leave 6 and 7 Nm of 31 and 28 in
// two.
constexpr double kTorqueTold_Nm = 10.0;
constexpr double kPowerLeast = 0.3;  // out over in: no variator loses or gains as much
constexpr double kCopyNoise = 0.3;   // rms of the difference over that of the noise

// One sample after the other, also where a copy was written with fewer digits or another time of
// its first sample: two experiments never share their noise.
bool same_channel(const Channel& a, const Channel& b) {
  constexpr double kSameTime_s = 1e-3;
  if (a.value.size() != b.value.size()) return false;
  double apart = 0.0, noise = 0.0;
  for (std::size_t i = 0; i < a.value.size(); ++i) {
    if (std::abs((a.t_s[i] - a.t_s[0]) - (b.t_s[i] - b.t_s[0])) > kSameTime_s) return false;
    apart += (a.value[i] - b.value[i]) * (a.value[i] - b.value[i]);
    if (i < 2) continue;
    const double bend = a.value[i - 2] - 2.0 * a.value[i - 1] + a.value[i];
    noise += bend * bend / 6.0;
  }
  return apart <= kCopyNoise * kCopyNoise * noise;
}

bool same_data(const SignalTable& a, const SignalTable& b) {
  constexpr std::array kTelling{Role::kPrimarySpeed, Role::kSecondarySpeed,
                                Role::kSecondaryPressure, Role::kPrimaryTorque,
                                Role::kEngineTorque};
  return std::all_of(kTelling.begin(), kTelling.end(),
                     [&](Role role) { return same_channel(a[role], b[role]); });
}

// 90 % of what a channel covers.
double range_of(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[(values.size() - 1) * 19 / 20] - values[(values.size() - 1) / 20];
}

constexpr double kSteady_rad_s2 = 5.0;  // chosen: an inertia of 0.5 kg m2 takes a few Nm

// What both shafts' torques of one experiment say of each other.
struct TorquePair {
  double same = 0.0, opposite = 0.0;  // products of both, by their signs
  double power_in_W = 0.0, power_out_W = 0.0, omega_p_sum_rad_s = 0.0;
  double range_in_Nm = 0.0, range_out_Nm = 0.0;  // out: as it were at the primary shaft
  double lost_W() const { return kTorqueTold_Nm * omega_p_sum_rad_s; }  // at most, by losses
};

TorquePair torque_pair(const ExperimentData& run) {
  TorquePair out;
  std::vector<double> in, at_primary;
  for (int k = 0; k < run.size(); ++k) {
    if (!run.valid[static_cast<std::size_t>(k)]) continue;
    // A shaft that is sped up or slowed down takes torque of its own, of either sign.
    if (std::abs(run.omega_p.slow_slope[k]) < kSteady_rad_s2) {
      const double product = run.torque.value[k] * run.torque_s.value[k];
      (product < 0.0 ? out.opposite : out.same) += std::abs(product);
      out.power_in_W += std::abs(run.torque.value[k]) * run.omega_p.value[k];
      out.power_out_W += std::abs(run.torque_s.value[k]) * run.omega_s.value[k];
      out.omega_p_sum_rad_s += run.omega_p.value[k];
    }
    in.push_back(run.torque.value[k]);
    at_primary.push_back(run.torque_s.value[k] * run.omega_s.value[k] / run.omega_p.value[k]);
  }
  out.range_in_Nm = range_of(std::move(in));
  out.range_out_Nm = range_of(std::move(at_primary));
  return out;
}

// Why these two torques cannot be of one variator; empty: they can.
std::string contradiction(const TorquePair& pair) {
  const double less_W = std::min(pair.power_in_W, pair.power_out_W);
  const double more_W = std::max(pair.power_in_W, pair.power_out_W);
  if (!(more_W > pair.lost_W())) return {};
  // What losses leave of a small torque may be of either sign.
  if (pair.opposite > pair.same && less_W > pair.lost_W()) {
    return "primary and secondary torque are of opposite sign: that of one is wrong";
  }
  if (!(less_W + pair.lost_W() > kPowerLeast * more_W)) {
    return "the power at the secondary shaft comes to " +
           text_of(pair.power_out_W / std::max(pair.power_in_W, 1e-9)) +
           " of that at the primary one: unit or scale of a torque?";
  }
  // A channel that does not move at all has stopped; with noise on it, it would.
  const auto stands = [](double here_Nm, double there_Nm) {
    return here_Nm < 1e-6 * there_Nm && there_Nm > kTorqueTold_Nm;
  };
  if (stands(pair.range_in_Nm, pair.range_out_Nm)) {
    return "the torque at the primary shaft stands still while that at the secondary one moves";
  }
  if (stands(pair.range_out_Nm, pair.range_in_Nm)) {
    return "secondary_torque stands still while the torque at the primary shaft moves";
  }
  return {};
}

// Looked at where the belt carries the least of what its clamp force lets it, and drive and overrun
// each for itself: a belt slips one way or the other by a percent even there, and by ten where a
// rig holds the slip and not the torque.
void check_same_ratio(const std::vector<ExperimentData>& runs,
                      const estimator::VariatorParameters& variator, int stop, double direction,
                      Implausible& doubts) {
  struct LeastLoad {
    double ratio = 0.0, force_kN = 0.0;
    const ExperimentData* run = nullptr;
  };
  std::vector<LeastLoad> all;
  for (const ExperimentData& run : runs) {
    double least_Nm_kN = std::numeric_limits<double>::infinity();
    LeastLoad here;
    for (int k = 0; k < run.size(); ++k) {
      if (!run.valid[static_cast<std::size_t>(k)] ||
          run.stop[static_cast<std::size_t>(k)] != stop || run.torque.value[k] * direction < 0.0) {
        continue;
      }
      const double force_kN = 1e-3 * estimator::secondary_clamp_force_N(
                                         variator, run.pressure.value[k], run.omega_s.value[k]);
      const double load_Nm_kN = std::abs(run.torque.value[k]) / force_kN;
      if (!(force_kN > 0.0) || load_Nm_kN >= least_Nm_kN) continue;
      least_Nm_kN = load_Nm_kN;
      here = {run.omega_s.value[k] / run.omega_p.value[k], force_kN, &run};
    }
    if (here.run != nullptr) all.push_back(here);
  }
  for (const LeastLoad& a : all) {
    for (const LeastLoad& b : all) {
      const double softness = kSoftestPerkN * std::max(0.0, a.force_kN - b.force_kN);
      if (b.ratio <= a.ratio * (kSameRatio + softness)) continue;
      doubts.notes.push_back(a.run->name + " and " + b.run->name + ": end-stop ratios " +
                             text_of(a.ratio) + " and " + text_of(b.ratio) +
                             " cannot be of one machine");
      doubts.impossible = Unexplained{"ratio", {"experiment"}, 1.0};
      return;
    }
  }
}

void drop_uneven(std::vector<ExperimentData>& runs, GridSignal ExperimentData::*channel,
                 const std::string& role, Implausible& doubts) {
  const ExperimentData *with = nullptr, *without = nullptr;
  for (const ExperimentData& run : runs) {
    if (run.valid_count > 0) ((run.*channel).present ? with : without) = &run;
  }
  if (with == nullptr || without == nullptr) return;
  for (ExperimentData& run : runs) (run.*channel).present = false;
  doubts.notes.push_back(without->name + ": no " + role + ", which other experiments have, as " +
                         with->name + "; what depends on it is not looked at");
}

}  // namespace

void drop_copies(std::vector<SignalTable>& tables, Implausible& doubts) {
  for (std::size_t i = 0; i < tables.size(); ++i) {
    for (std::size_t j = i + 1; j < tables.size();) {
      if (!same_data(tables[i], tables[j])) {
        ++j;
        continue;
      }
      doubts.notes.push_back(tables[j].name + ": the same data as " + tables[i].name +
                             "; counted once");
      tables.erase(tables.begin() + static_cast<std::ptrdiff_t>(j));
    }
  }
}

void drop_copies_of(const std::vector<SignalTable>& fitted, std::vector<SignalTable>& held_out,
                    Implausible& doubts) {
  std::erase_if(held_out, [&](const SignalTable& table) {
    const auto same = std::find_if(fitted.begin(), fitted.end(),
                                   [&](const SignalTable& each) { return same_data(each, table); });
    if (same == fitted.end()) return false;
    doubts.notes.push_back(table.name + ": the same data as " + same->name + "; not held out");
    return true;
  });
}

void drop_uneven_channels(std::vector<ExperimentData>& runs, Implausible& doubts) {
  drop_uneven(runs, &ExperimentData::temperature, "oil_temperature", doubts);
  drop_uneven(runs, &ExperimentData::command, "secondary_pressure_command", doubts);
}

void check_same_machine(const std::vector<ExperimentData>& runs,
                        const estimator::VariatorParameters& variator, Implausible& doubts) {
  for (const int stop : {kOverdriveStop, kLowStop}) {
    for (const double direction : {1.0, -1.0}) {
      check_same_ratio(runs, variator, stop, direction, doubts);
    }
  }
}

void check_torques(const std::vector<ExperimentData>& runs, Implausible& doubts) {
  for (const ExperimentData& run : runs) {
    if (!run.torque_s.present) continue;
    const std::string what = contradiction(torque_pair(run));
    if (!what.empty()) doubts.torques.push_back(run.name + ": " + what);
  }
}

void torques_are_impossible(Implausible& doubts) {
  if (doubts.torques.empty()) return;
  doubts.impossible = Unexplained{"torque", {"secondary_torque"}, 1.0};
  doubts.notes.insert(doubts.notes.end(), doubts.torques.begin(), doubts.torques.end());
}

void check_friction(const std::vector<ExperimentData>& runs,
                    const estimator::VariatorParameters& variator, Implausible& doubts) {
  std::vector<double> mu;
  double highest_Pa = 0.0;
  for (const ExperimentData& run : runs) {
    for (int k = 0; k < run.size(); ++k) {
      if (!run.valid[static_cast<std::size_t>(k)]) continue;
      const bool low = run.stop[static_cast<std::size_t>(k)] == kLowStop;
      const double radius_m =
          low ? variator.primary_radius_low_m : variator.primary_radius_overdrive_m;
      const double force_N =
          estimator::secondary_clamp_force_N(variator, run.pressure.value[k], run.omega_s.value[k]);
      mu.push_back(std::abs(run.torque.value[k]) * std::cos(variator.half_wedge_angle_rad) /
                   (2.0 * radius_m * std::max(force_N, 1.0)));
      highest_Pa = std::max(highest_Pa, run.pressure.value[k]);
    }
  }
  if (mu.empty()) return;
  const double top = estimator::at_rank(mu, mu.size() * 99 / 100);
  if (top < kMuMost && highest_Pa < kPressureMost_Pa) return;
  doubts.notes.push_back("friction comes to " + text_of(top) + " and the pressure to " +
                         text_of(highest_Pa / 1e5) +
                         " bar, which no belt drive has: unit or scale of the pressure or the "
                         "torque, or secondary_piston_area_m2 of [variator]?");
  doubts.impossible = Unexplained{"friction", {"secondary_pressure", "torque"}, 1.0};
}

bool is_no_belts(double mu_max) { return mu_max < kMuLeast; }

void check_fitted_friction(const std::map<std::string, Interval>& machine, Implausible& doubts) {
  const Interval& mu_max = machine.at("mu_max");
  const auto slips = [&](const char* name) {
    const auto found = machine.find(name);
    return found != machine.end() && found->second.low > kPeakSlipMost_share;
  };
  if (!is_no_belts(mu_max.high) && !slips("peak_slip_overdrive") && !slips("peak_slip_low")) return;
  doubts.notes.push_back("friction comes to its peak at " + text_of(mu_max.value) +
                         " or far beyond the slip of belts: unit or scale of the pressure or the "
                         "torque, or secondary_piston_area_m2 of [variator]?");
  doubts.impossible = Unexplained{"friction", {"secondary_pressure", "torque"}, 1.0};
}

}  // namespace beltgrip::diagnose
