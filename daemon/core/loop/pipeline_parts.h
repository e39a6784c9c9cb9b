// What a Pipeline is made of; seen by pipeline.cpp and pipeline_setup.cpp only.
#pragma once

#include <cmath>
#include <memory>
#include <optional>

#include "daemon/core/experiment/arming.h"
#include "daemon/core/experiment/clamp_request.h"
#include "daemon/core/guard/safety_monitor.h"
#include "daemon/core/guard/tx_gate.h"
#include "daemon/core/input/input_monitor.h"
#include "daemon/core/input/sampler.h"
#include "daemon/core/loop/pipeline.h"
#include "daemon/core/publish/publisher.h"
#include "estimator/physics/assumed_constants.h"
#include "estimator/signal/input_correction.h"

namespace beltgrip::daemon {

inline Duration sample_period(const Config& config) {
  return std::llround(static_cast<double>(kSecond) / config.estimator.sample_rate_hz);
}

struct Pipeline::Parts {
  explicit Parts(const Config& config);

  void go_on_from(const Parts& before, bool keeps_results) noexcept;
  void take_own_frame(const RxFrame& frame) noexcept;
  bool buses_up() const noexcept;  // those that are needed
  void raise_bus_faults(MonoTime t) noexcept;
  bool by_conditions() const noexcept;  // trigger "coast_down" or "steady"
  // A fault under which nothing may be asked; two of them stay until a restart.
  bool forbidden() const noexcept {
    return faults.has(Fault::kForeignSender) || faults.has(Fault::kFrameRefused) ||
           faults.has(Fault::kClampStuck);
  }
  bool commands() const noexcept { return config.control == Control::kCommand; }
  // An experiment is what others do to the belt while the trigger's conditions hold.
  bool observes() const noexcept { return by_conditions() && !commands(); }
  bool triggered() const noexcept;
  Stop ended_by() const noexcept;
  bool observed_over() const noexcept;
  double value_or(Role role, double otherwise, bool& fresh) const noexcept;
  double value_if_known(Role role) const noexcept;  // 0: it is not
  Conditions read_conditions() const noexcept;
  Duration slowest_stale() const noexcept;
  double known_as_read(std::size_t index) const noexcept;
  double measured_force_N() const noexcept;
  ClampRequest::Now request_now(MonoTime t) const noexcept;
  void arm(MonoTime t) noexcept;
  void announce(MonoTime t) noexcept;
  void step_request(MonoTime t) noexcept;
  bool unconfirmed(MonoTime t) const noexcept;
  bool starved(MonoTime t) const noexcept;
  void ask_again(MonoTime t) noexcept;
  bool usable_again(MonoTime t) const noexcept;
  void withdraw(const Stop& stop) noexcept;
  void judge_following(MonoTime t) noexcept;
  void judge_release(MonoTime t) noexcept;
  void judge_safety(MonoTime t) noexcept;
  void withdraw_for_bus(MonoTime t) noexcept;
  void watch_inputs() noexcept;
  Stop missing_condition() const noexcept;
  Stop lost(MonoTime t) const noexcept;
  StopCause estimator_cause() const noexcept;
  Stop abort_of(estimator::StopReason reason, MonoTime t) const noexcept;
  Guards guards(MonoTime t) const noexcept;
  void apply(const Transition& transition, MonoTime t) noexcept;
  void step(MonoTime t) noexcept;
  void stop(MonoTime t, const Stop& why) noexcept;
  bool evaluate() noexcept;
  void read_peak() noexcept;
  void bound_only() noexcept;
  void begin_weighing(double mu, double force_N, double relative_noise) noexcept;
  void weigh_peak() noexcept;
  double top_reached() const noexcept;
  double top_force_N() const noexcept;
  void weigh_top() noexcept;
  estimator::PeakReading reading_at(double mu, double force_N) const noexcept;
  void publish_result(Outcome outcome) noexcept;
  Outcome judged_outcome() const noexcept;
  void raise_history_faults(MonoTime t) noexcept;
  void keep_measured() noexcept;
  double friction_to_rest_on() const noexcept;
  double friction_measured(std::size_t index) const noexcept;
  double share_slipped(std::size_t index) const noexcept;
  double share_left(std::size_t index) const noexcept;
  double traction_1_m(std::size_t index) const noexcept;
  bool stopped_by_slip() const noexcept;
  void keep_slipped() noexcept;
  SlipShown& shown(estimator::Direction direction, estimator::EndStop end_stop) noexcept;
  void report(MonoTime t) noexcept;
  Publication publication() const noexcept;
  void pass_gate(const Outbox& wanted, Outbox& outbox) noexcept;

  Config config;
  InputMonitor inputs;
  Sampler sampler;
  std::optional<estimator::AssumedConstants> assumptions;  // where there are any
  std::optional<estimator::InputCorrection> correction;    // where the configuration names a model
  std::unique_ptr<estimator::SlipCurveEstimator> estimator;
  Publisher publisher;
  TxGate gate;
  FaultSet faults;
  PipelineCounters counters;
  std::uint64_t refused_before = 0;  // under the configurations before this one
  SampleReport last;                 // as reported
  Arming arming;
  ClampRequest request;
  SafetyMonitor safety;
  Conditions conditions;

  State state = State::kInhibited;
  bool macro_slip_stop = false;
  bool samples_lost = false;              // since the last sample
  MonoTime last_usable = 0;               // sample
  std::optional<MonoTime> last_unusable;  // sample, after a usable one
  bool was_usable = false;                // a sample
  bool refused = false;                   // the experiment under way never began
  std::optional<MonoTime> announced;      // a request, by inactive frames
  bool misread = false;                   // the pressure, as the force came back after the request
  Stop backup_stop;                       // at this sample
  Stop withdrawn;                         // at this sample
  bool clamp_refused = false;             // by the gate, or by the port: since the last sample
  bool clamp_unconfirmed = false;         // a clamp frame waits for its echo
  MonoTime clamp_sent = 0;                // the first that waits
  bool estimate_changed = false;          // with this sample
  ExperimentResult running;               // the experiment under way
  // Its evaluation takes some samples: the curve, what the assumptions make of its peak, and of the
  // top that points on no one curve reached.
  enum class Evaluation { kCurve, kPeak, kTop, kDone };
  Evaluation evaluation = Evaluation::kCurve;
  bool weighing = false;               // by the assumptions, begun
  ExperimentResult result;             // the last that came to its outcome
  EstimateValues estimate;             // the last that had a result
  estimator::LearnedFriction learned;  // over all experiments, where they are kept
  double friction_as_read = 0.0;       // mu_max of `estimate` under the configuration's constants
  // The newest results of the belt; those from before the start come with `learned`, which may be
  // long after it.
  estimator::BeltMemory memory;
  bool remembers = false;  // a result of its own: `memory` is newer than what is learned
  double sigma_first_percent = 0.0;
  double mu_star_most = 0.0;   // in the experiment under way
  bool contradictory = false;  // the last result, in itself; until a measured one settles it
  double omega_s_at_start = 0.0;
  double own_force_N = 0.0;       // before the experiment under way
  double slip_own_percent = 0.0;  // of the experiment under way, before it began
  // By direction and end stop.
  std::array<std::array<SlipShown, 2>, 2> slip_shown{};

  struct BusHealth {
    bool needed = false;                      // an experiment cannot go on without it
    BusState link = BusState::kActive;        // as the port sees it
    BusState controller = BusState::kActive;  // as error frames tell it
    MonoTime off_since = 0;                   // with kOff
    bool up() const noexcept {
      return link != BusState::kDown && link != BusState::kAbsent && link != BusState::kOff &&
             controller != BusState::kOff;
    }
  };
  std::array<BusHealth, kBusMax> buses;
};

}  // namespace beltgrip::daemon
