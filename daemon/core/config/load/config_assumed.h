// What is left out is not known exactly: a result says what it rests on. Start-up and tools only.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "daemon/core/config/load/load_config.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/config/options/config_options.h"
#include "daemon/core/config/toml/config_document.h"

namespace beltgrip::daemon {

using SensorTexts = std::array<SensorText, kRoleCount>;  // by role

// `model_keys`: of [variator], that the model file states.
estimator::ConstantSet left_out_constants(const TomlNode& root,
                                          const std::vector<std::string>& model_keys);
void assume(const estimator::ConstantSet& left_out, SensorTexts& sensors, Config& config);
// The same for who reads no more than what [sensors] states: of a sensor that it leaves out beside
// others.
void assume_beside(const SensorTexts& sensors, ConfigResult& result);

}  // namespace beltgrip::daemon
