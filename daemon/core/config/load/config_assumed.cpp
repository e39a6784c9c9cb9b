#include "daemon/core/config/load/config_assumed.h"

#include <algorithm>

namespace beltgrip::daemon {

namespace {

void assume_constants(const TomlNode& root, const std::vector<std::string>& model_keys,
                      Config& config) {
  using estimator::Constant;
  using estimator::RatioChoice;
  const TomlNode* stated = section_of(root, "variator");
  const auto is_needed = [&](Constant constant) {
    switch (constant) {
      case Constant::kRadiusOverdrive:
        return config.estimator.ratio != RatioChoice::kLow;
      case Constant::kRadiusLow:
        return config.estimator.ratio != RatioChoice::kOverdrive;
      case Constant::kPrimaryInertia:
        return config.estimator.torque_is_engine;
      default:
        return true;
    }
  };
  for (std::size_t i = 0; i < estimator::kConstantCount; ++i) {
    const estimator::Assumption& each = estimator::assumptions()[i];
    const bool in_model =
        std::find(model_keys.begin(), model_keys.end(), each.key) != model_keys.end();
    const bool in_file = stated != nullptr && stated->find(each.key) != nullptr;
    if (in_model || in_file || !is_needed(static_cast<Constant>(i))) continue;
    config.assumed_constants.set(i);
    config.assumed.push_back(key_of("variator", each.key));
    config.friction_is_assumed = true;
  }
}

void assume_accuracy(Role role, bool decides, SensorText& sensor, Config& config) {
  const std::optional<estimator::Sensor> channel = sensor_of(role);
  if (!channel) return;
  const estimator::ChannelAccuracy& typical = estimator::typical_accuracy(*channel).accuracy;
  const std::string key = key_of("sensors", role_name(role));
  const auto value = [&](std::optional<double>& stated, double usual, std::string_view name) {
    if (stated) return;
    stated = usual;
    config.assumed.push_back(key_of(key, name));
    config.friction_is_assumed |= decides;
  };
  value(sensor.bias, typical.bias, bias_key(role_dimension(role)));
  value(sensor.gain, typical.gain, "gain");
}

}  // namespace

void assume(const TomlNode& root, const std::vector<std::string>& model_keys, SensorTexts& sensors,
            Config& config) {
  assume_constants(root, model_keys, config);
  const auto accuracy = [&](Role role, bool decides) {
    assume_accuracy(role, decides, sensors[static_cast<std::size_t>(role)], config);
  };
  accuracy(Role::kPrimarySpeed, false);
  accuracy(Role::kSecondarySpeed, false);
  accuracy(Role::kSecondaryPressure, true);
  accuracy(config.estimator.torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque, true);
  // Chosen: what is refused must be impossible at any end of the assumptions. At light clamping
  // these are about 1.1 (radius), 1.2 (area), 1.3 (spring) and 1.3 (inertia), together 2.2.
  constexpr double kReach = 3.0;
  if (config.friction_is_assumed) config.estimator.reading_reach = kReach;
}

void assume_beside(const SensorTexts& sensors, ConfigResult& result) {
  const bool states_any = std::any_of(sensors.begin(), sensors.end(), [](const SensorText& each) {
    return each.bias.has_value() || each.gain.has_value();
  });
  if (!states_any) return;
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    const Role role = static_cast<Role>(i);
    const std::optional<estimator::Sensor> sensor = sensor_of(role);
    if (!sensor) continue;
    const estimator::ChannelAccuracy& typical = estimator::typical_accuracy(*sensor).accuracy;
    const std::string key = key_of("sensors", role_name(role));
    const auto value = [&](const std::optional<double>& stated, double usual, std::string_view name,
                           double& out) {
      if (stated) return;
      out = usual;
      result.assumed.push_back({role, key_of(key, name), usual});
    };
    value(sensors[i].bias, typical.bias, bias_key(role_dimension(role)), result.stated[i].bias);
    value(sensors[i].gain, typical.gain, "gain", result.stated[i].gain);
  }
}

}  // namespace beltgrip::daemon
