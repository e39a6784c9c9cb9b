// A campaign case run with the daemon, and where the belt slips beyond a limit without it too,
// judged by the promises, as one line of JSON.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tests/loop/closed_loop.h"
#include "tests/statistics/campaign/campaign_case.h"
#include "tests/statistics/campaign/reach.h"

namespace beltgrip::test {

struct CampaignVerdict {
  struct Experiment {
    std::string outcome;  // "Refused": no request was made
    std::string stop_reason;
    std::string cause;  // in words, with its figures
    double begin_s = 0.0, end_s = 0.0;
    std::optional<double> mu_error_percent;  // completed
    bool covered = false;                    // and the interval holds the truth
  };

  std::uint64_t seed = 0;
  std::string base;
  std::vector<std::string> faults;
  bool guaranteed = true;  // promise G1 is meant for it
  double fall_per_percent = 0.0;
  int requests = 0;
  std::vector<Experiment> experiments;
  double slip_max_percent = 0.0;  // over all requests, truth
  double slip_stop_percent = 0.0;
  double slip_speed_max_m_s = 0.0;
  double energy_J = 0.0;  // beyond the peak's slip
  bool has_peak = true;
  std::optional<double> alone_slip_percent;  // the same instants without the daemon
  // Where G1 is broken: had the controller taken its force back as the belt passed its peak, before
  // any reaction can.
  std::optional<double> at_once_slip_percent, at_once_energy_J;
  bool broken_at_once = false;  // and G1 is broken even then
  std::optional<Reach> reach;   // of a coast-down with nothing wrong
  std::vector<Reaction> reactions;
  std::vector<std::string> violations;
};

CampaignVerdict run_case(const CampaignCase& given);
std::string to_json(const CampaignVerdict& verdict);

}  // namespace beltgrip::test
