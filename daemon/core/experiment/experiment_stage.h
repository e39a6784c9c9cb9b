// Third stage of a sample: when an experiment begins, what its request asks for, and when and why
// it ends. Its own state alone; what it finds is given back as values. Real-time thread.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <optional>

#include "daemon/core/base/faults.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/estimate/ended_experiment.h"
#include "daemon/core/estimate/estimate_stage.h"
#include "daemon/core/estimate/known_friction.h"
#include "daemon/core/experiment/arming.h"
#include "daemon/core/experiment/clamp_request.h"
#include "daemon/core/experiment/drive_changes.h"
#include "daemon/core/experiment/experiment.h"
#include "daemon/core/experiment/fall_shown.h"
#include "daemon/core/experiment/own_force.h"
#include "daemon/core/experiment/recorded_requests.h"
#include "daemon/core/guard/safety_monitor.h"
#include "daemon/core/input/input_stage.h"

namespace beltgrip::daemon {

using RoleSet = std::bitset<kRoleCount>;

class ExperimentStage {
 public:
  // config outlives it. recorded: it follows these requests and asks for nothing itself.
  ExperimentStage(const Config& config, std::optional<RecordedRequests> recorded);

  // One sample, as the other stages have it.
  struct Now {
    MonoTime t = MonoTime::origin();
    const InputStage& input;
    const EstimateStage& estimate;  // before begin() of the sample before, after it of this one
    FaultSet& faults;
    bool unconfirmed = false;    // clamp frames that were asked for are not on the bus
    bool inactive_sent = false;  // no inactive clamp frame is left to be sent
  };

  // --- the steps of a sample, in this order ---
  // How the inputs should move while a request stands, and until the force is back. torque_Nm: on
  // the belt, at the sample before.
  InputMonitor::Watch watch(double torque_Nm) const noexcept;
  // The trigger's preconditions. True: a request may come, and the receiver is to hear inactive
  // frames first.
  bool arm(const Now& now, const KnownFriction& known, double friction_as_read) noexcept;
  // An experiment begins before the sample is used.
  Action begin(const Now& now) noexcept;
  // The sample has been used.
  void count(const Now& now) noexcept;
  // A standing request falls, or something ends it. What has been found to stand still.
  RoleSet step_request(const Now& now) noexcept;
  // What the safety monitor says of the request that results: its word is the last.
  void take(SafetyVerdict verdict, double figure, double limit, const Now& now) noexcept;
  // An experiment stops, or is over, after the sample is used.
  Action end(const Now& now) noexcept;
  // Its evaluation is done.
  void conclude(const estimator::PeakEstimate& peak, double sensor_std, bool slipped) noexcept;
  void release(const Now& now) noexcept;

  // The program or the log ends. True: the experiment under way is to be evaluated.
  bool cut_short(MonoTime t, estimator::StopReason reason, const Now& now) noexcept;
  void go_idle(MonoTime t) noexcept;
  void on_clamp_refused() noexcept { clamp_refused_ = true; }

  State state() const noexcept { return state_; }
  bool runs() const noexcept;
  bool commands() const noexcept { return config_.control == Control::kCommand; }
  // Clamp frames may leave at all.
  bool asks() const noexcept { return commands() && !by_record_; }
  bool by_conditions() const noexcept {  // trigger "coast_down" or "steady"
    return config_.trigger == Trigger::kCoastDown || config_.trigger == Trigger::kSteady;
  }
  const Conditions& conditions() const noexcept { return conditions_; }
  // As asked for with this sample; 0: no request stands.
  double request_force_N() const noexcept {
    return state_ == State::kRamping ? request_.force_N() : 0.0;
  }
  double ramp_N_per_s() const noexcept {
    return state_ == State::kRamping && commands() ? request_.rate_N_per_s() : 0.0;
  }
  bool macro_slip_stop() const noexcept { return macro_slip_stop_; }
  const ExperimentResult& running() const noexcept { return running_; }  // or the last one
  const ExperimentResult& result() const noexcept { return result_; }
  bool new_result() const noexcept { return new_result_; }  // with this sample
  // Why a request is forbidden, where one of the inhibits does that.
  StopCause obstacle() const noexcept;
  std::uint32_t inhibits() const noexcept { return by_conditions() ? arming_.inhibits() : 0U; }
  bool stopped_by_slip() const noexcept;
  // Its own stop, for friction that no longer rises with slip.
  bool stopped_at_the_top() const noexcept;
  EndedExperiment ended() const noexcept;

  void go_on_from(const ExperimentStage& before, bool keeps_results) noexcept;

 private:
  // An experiment is what others do to the belt while the trigger's conditions hold.
  bool observes() const noexcept { return by_conditions() && !commands(); }
  Conditions read_conditions(const InputMonitor& channels) const noexcept;
  bool announces() noexcept;
  bool triggered(const Now& now) const noexcept;
  Stop ended_by(const estimator::VariatorSample& sample) const noexcept;
  bool observed_over(const Now& now) const noexcept;
  ClampRequest::Now request_now(const Now& now) const noexcept;
  AnswerLag::Reading force_reading(const Now& now) const noexcept;
  DriveChanges::Now drive_now(const Now& now) const noexcept;
  bool starved(const Now& now) const noexcept;
  Stop lost(const Now& now) const noexcept;
  void withdraw(const Stop& stop) noexcept;
  void withdraw_for_bus(const Now& now) noexcept;
  void judge_following(const Now& now, RoleSet& still) noexcept;
  void judge_release(const Now& now, RoleSet& still) noexcept;
  void judge_own_force(const Now& now) noexcept;
  bool follows_on() const noexcept;
  void go_by_record(const estimator::CurveEstimate& curve, RoleSet& still) noexcept;
  void guard_by_record(Guards& guards) const noexcept;
  Guards guards(const Now& now) const noexcept;
  Action apply(const Transition& transition, const Now& now) noexcept;
  void start(const Now& now) noexcept;
  void stop(MonoTime t, const Stop& why, const Now& now) noexcept;
  Stop abort_of(estimator::StopReason reason, const Now& now) const noexcept;
  void keep_result(Outcome outcome) noexcept;
  SlipShown& shown(estimator::Direction direction, estimator::EndStop end_stop) noexcept;
  FallShown& fall_shown(estimator::Direction direction, estimator::EndStop end_stop) noexcept;

  const Config& config_;
  Arming arming_;
  ClampRequest request_;
  DriveChanges changes_;
  OwnForce returned_;  // the controller's, after a request
  bool by_record_;
  RecordedRequests recorded_;
  bool would_ask_ = false;                     // were it not for recorded_, since the trigger holds
  const RecordedRequest* followed_ = nullptr;  // of recorded_: the last that an experiment took up
  Conditions conditions_;
  State state_ = State::kInhibited;
  bool macro_slip_stop_ = false;
  bool refused_ = false;               // the experiment under way never began
  std::optional<MonoTime> announced_;  // a request, by inactive frames
  bool misread_ = false;               // the pressure, as the force came back after the request
  Stop backup_stop_;                   // at this sample
  Stop withdrawn_;                     // at this sample
  bool clamp_refused_ = false;         // a clamp frame could not be sent since the last sample
  bool new_result_ = false;
  ExperimentResult running_;  // the experiment under way
  ExperimentResult result_;   // the last that came to its outcome
  double sigma_first_percent_ = 0.0;
  double mu_star_most_ = 0.0;  // in the experiment under way
  LastPoints last_points_;     // of it
  double omega_s_start_rad_s_ = 0.0;
  double own_force_N_ = 0.0;       // before the experiment under way
  double slip_own_percent_ = 0.0;  // of the experiment under way, before it began
  // By direction and end stop.
  std::array<std::array<SlipShown, 2>, 2> slip_shown_{};
  std::array<std::array<FallShown, 2>, 2> fall_shown_{};
};

}  // namespace beltgrip::daemon
