// Construction of the pipeline: all its memory is taken here, at start-up.
#include <cmath>

#include "daemon/core/pipeline_parts.h"

namespace beltgrip::daemon {

namespace {
Duration sample_period(const Config& config) {
  return std::llround(static_cast<double>(kSecond) / config.estimator.sample_rate_hz);
}
}  // namespace

Pipeline::Parts::Parts(const Config& given)
    : config(given),
      inputs(config),
      sampler(inputs, config.estimator.torque_is_engine),
      estimator(
          estimator::make_slip_curve_estimator(config.estimator, config.variator, config.sensors)),
      publisher(config.identifiers, sample_period(config)),
      gate(config.identifiers, config.control) {
  estimator->reset();
}

Pipeline::Pipeline(const Config& config) : parts_(std::make_unique<Parts>(config)) {}
Pipeline::~Pipeline() = default;

}  // namespace beltgrip::daemon
