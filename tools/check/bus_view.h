// The driving itself, from the daemon's own inputs, in windows of half a second: what belongs
// together across roles, and the conditions of an experiment as the daemon would judge them.
// Tools only.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/config/options/config.h"
#include "daemon/core/experiment/arming.h"
#include "daemon/core/loop/loop.h"
#include "daemon/core/loop/pipeline.h"
#include "tools/check/role_watch.h"
#include "tools/check/thinned.h"

namespace beltgrip::check {

using daemon::Inhibit;

// Means over the window, SI. NaN: no value of the role for all of it.
struct Window {
  std::array<double, daemon::kRoleCount> mean;
  std::array<double, daemon::kRoleCount> change;  // from its first to its last value, a second
  double mu_star = std::numeric_limits<double>::quiet_NaN();  // magnitude, at an end stop
  double slip_percent = std::numeric_limits<double>::quiet_NaN();

  double operator[](Role role) const { return mean[static_cast<std::size_t>(role)]; }
  double rate(Role role) const { return change[static_cast<std::size_t>(role)]; }
};

// What an experiment would need, and whether the driving had it.
struct Opportunity {
  double begin_s = 0.0, length_s = 0.0;
  double torque_Nm = 0.0;    // magnitude, where the reach was best
  double floor_N = 0.0;      // lowest force of a request there
  double own_force_N = 0.0;  // the controller's
  double needed_Nm = 0.0;    // torque from which the peak is in reach
  double omega_p_rad_s = 0.0;
  bool low = false;  // end stop
  bool in_reach = false;
  std::uint32_t forbidden = 0;  // daemon::inhibit_bit()s that kept it away to its end
};
struct Prospects {
  bool judged = false;  // triggers "coast_down" and "steady"
  std::uint64_t opportunities = 0, in_reach = 0;
  std::array<std::uint64_t, daemon::kInhibitCount> forbidden_by{};
  std::array<std::string, daemon::kInhibitCount> figures;  // beside its limit, as each first stood
  std::optional<Opportunity> best;
  std::uint64_t experiments = 0;  // other triggers: that ran
  double carried_most = 0.0;      // and the highest friction that was carried in them
};

class BusView final : public daemon::SampleSink {
 public:
  // All outlive it. The pipeline is one in which no experiment begins by the car's conditions.
  BusView(const daemon::Config& config, const RoleWatch& watch, const daemon::Pipeline& pipeline,
          Thinned<Window>& windows, Prospects& prospects);
  ~BusView() override;

  void on_report(const daemon::SampleReport& report) noexcept override;

 private:
  void take_window(const daemon::SampleReport& report);
  void take_arming(const daemon::SampleReport& report);
  void end_opportunity();
  void note_figure(Inhibit inhibit, std::uint32_t inhibits, const daemon::Obstacle& obstacle,
                   daemon::SampleReport report);
  daemon::Duration slowest_stale() const;
  daemon::Conditions conditions() const;
  double value(Role role) const;

  const daemon::Config& config_;
  const RoleWatch& watch_;
  const daemon::Pipeline& pipeline_;
  Thinned<Window>& windows_;
  Prospects& prospects_;
  daemon::Arming arming_;    // as if it asked for force
  daemon::Arming settling_;  // and as if it did not: the trigger alone

  std::optional<daemon::MonoTime> window_begin_;
  int samples_ = 0;
  std::array<double, daemon::kRoleCount> sum_{}, first_{}, last_{};
  std::array<int, daemon::kRoleCount> count_{};
  double mu_sum_ = 0.0, slip_sum_percent_ = 0.0;
  int mu_count_ = 0;

  std::optional<daemon::MonoTime> begin_;  // of the driving
  daemon::MonoTime held_since_;
  bool held_ = false;
  bool settled_ = false;
  daemon::Duration stale_;
  std::array<std::uint64_t, daemon::kInhibitCount> unclear_samples_{};
  Opportunity now_;
  double best_reach_ = 0.0;
  std::uint32_t missing_ = 0;  // few conditions, all others hold
  daemon::MonoTime missing_since_, newest_;
  bool missing_counted_ = false;
};

}  // namespace beltgrip::check
