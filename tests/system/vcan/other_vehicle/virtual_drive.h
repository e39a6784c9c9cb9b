// The other car beside the daemon's own pipeline in one process and in virtual time: what depends
// on no socket and no scheduler is shown here by many drives in seconds.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "daemon/core/loop/pipeline.h"
#include "tests/system/vcan/other_vehicle/ride.h"

namespace beltgrip::other {

class VirtualDrive final : public Ride {
 public:
  // settings: further lines of [experiment].
  VirtualDrive(const Kind& kind, std::size_t seed, const std::string& settings = "");

  daemon::State state() const { return pipeline_->report().state; }
  const std::vector<daemon::ExperimentResult>& experiments() const { return experiments_; }

 private:
  void exchange() override;
  void put(canid_t id, const Bytes& frame) override;
  void sample(daemon::MonoTime t);

  std::unique_ptr<daemon::Pipeline> pipeline_;
  daemon::MonoTime next_sample_;
  std::vector<can::CanFrame> under_way_;  // to the car
  std::vector<daemon::ExperimentResult> experiments_;
};

}  // namespace beltgrip::other
