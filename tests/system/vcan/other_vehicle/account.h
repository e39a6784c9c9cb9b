// What this car saw of BeltGrip: what its belt went through, and whether the frames kept what
// daemon/CLAMP_CONTRACT.md and interfaces.md promise. It knows the truth and nothing of the
// daemon's code.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tests/system/vcan/other_vehicle/car.h"
#include "tests/system/vcan/other_vehicle/frames.h"

namespace beltgrip::other {

struct Harm {
  double slip_percent = 0.0, slip_m_s = 0.0;  // the greatest
  double beyond_peak_J = 0.0;
};

struct Request {
  double begin_s = 0.0, last_active_s = 0.0;
  double first_N = 0.0, last_N = 0.0;
  double given_at_begin_N = 0.0;
  double given_least_N = 1e9;
  double most_above_N = 0.0, most_below_N = 0.0;  // the force given against that asked for
  int frames = 0;
  Harm harm;  // until the next request begins
};

struct Result {
  double t_s = 0.0;
  unsigned kind = 0;  // 1 value, 2 lower bound
  double mu_max = 0.0, std = 0.0;
};

struct Status {
  unsigned state = 0, outcome = 0, stop_reason = 0;
  std::uint64_t faults = 0;  // from bit 24 of the frame on
};

class Account {
 public:
  void step(const Belt& belt);
  void frame(double t_s, canid_t id, const Bytes& frame, const Belt& belt, double secondary_rad_s);
  // Another process of the daemon: counters begin anew.
  void another_daemon();

  const std::vector<Request>& requests() const { return requests_; }
  const std::vector<Result>& results() const { return results_; }
  const Status& status() const { return status_; }
  bool request_stands() const { return stands_; }
  // Five inactive frames have followed the last request.
  bool ended_right() const { return idle_frames_ >= 5; }
  // Stop reasons and faults that were published.
  bool stop_reason_seen(unsigned reason) const { return reasons_ >> reason & 1U; }
  bool fault_seen(int bit) const { return faults_ >> (bit - 24) & 1U; }
  // Promises that were broken, one line each.
  const std::vector<std::string>& breaches() const { return breaches_; }
  std::string text(double mu_max) const;

 private:
  void breach(double t_s, const std::string& what);
  bool protected_right(double t_s, canid_t id, const Bytes& frame);
  void clamp(double t_s, const Bytes& frame, const Belt& belt, double secondary_rad_s);
  void active(double t_s, double force_N, const Belt& belt, double secondary_rad_s);
  void estimate(double t_s, const Bytes& frame);
  void slip(double t_s, const Bytes& frame);

  std::vector<Request> requests_;
  std::vector<Result> results_;
  std::vector<std::string> breaches_;
  std::map<canid_t, unsigned> counters_;
  Harm whole_;
  Status status_;
  std::uint64_t reasons_ = 0, faults_ = 0;
  bool stands_ = false;
  int idle_frames_ = 0;
  std::optional<double> stop_flag_s_;
  unsigned experiment_count_ = 0;
};

}  // namespace beltgrip::other
