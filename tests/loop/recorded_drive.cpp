#include "tests/loop/recorded_drive.h"

#include "daemon/core/loop/loop.h"
#include "tools/sim/vehicle_port.h"

namespace beltgrip::test {

namespace {

class Keeper final : public daemon::SampleSink {
 public:
  explicit Keeper(std::vector<DriveStep>& steps) : steps_(steps) {}
  void on_report(const daemon::SampleReport& report) noexcept override {
    steps_.push_back({false, {}, report.t, report.state});
  }

 private:
  std::vector<DriveStep>& steps_;
};

}  // namespace

std::vector<DriveStep> record_drive(const sim::VehicleScenario& scenario,
                                    const daemon::Config& config) {
  std::vector<DriveStep> steps;
  sim::VehiclePort::Observers observers;
  observers.on_received = [&](const daemon::RxFrame& frame) {
    steps.push_back({true, frame, {}, daemon::State::kInhibited});
  };
  sim::VehiclePort port(scenario, 1, observers);
  daemon::Pipeline pipeline(config);
  Keeper keeper(steps);
  daemon::run_loop(port, pipeline, config.estimator.sample_rate_hz,
                   estimator::StopReason::kShutdown, &keeper);
  steps.pop_back();  // the end is no sample
  return steps;
}

}  // namespace beltgrip::test
