#include "daemon/core/config/load/config_assumed.h"

#include <algorithm>

namespace beltgrip::daemon {

namespace {

void assume_constants(const estimator::ConstantSet& left_out, Config& config) {
  using estimator::Constant;
  using estimator::RatioChoice;
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
    if (!left_out.test(i) || !is_needed(static_cast<Constant>(i))) continue;
    config.assumed_constants.set(i);
    config.assumed.push_back(key_of("variator", estimator::assumptions()[i].key));
    config.friction_is_assumed = true;
  }
}

// A key of a sensor that [sensors] leaves out, and what is usual in its place.
struct LeftOut {
  std::string key;
  double usual;
  std::optional<double> SensorText::*text;
  double estimator::ChannelAccuracy::*value;
};

std::vector<LeftOut> left_out(Role role, const SensorText& sensor) {
  const std::optional<estimator::Sensor> channel = sensor_of(role);
  if (!channel) return {};
  const std::string key = key_of("sensors", role_name(role));
  const estimator::ChannelAccuracy& typical = estimator::typical_accuracy(*channel).accuracy;
  std::vector<LeftOut> out;
  if (!sensor.bias) {
    out.push_back({key_of(key, bias_key(role_dimension(role))), typical.bias, &SensorText::bias,
                   &estimator::ChannelAccuracy::bias});
  }
  if (!sensor.gain) {
    out.push_back(
        {key_of(key, "gain"), typical.gain, &SensorText::gain, &estimator::ChannelAccuracy::gain});
  }
  return out;
}

void assume_accuracy(Role role, bool decides, SensorText& sensor, Config& config) {
  for (const LeftOut& each : left_out(role, sensor)) {
    sensor.*each.text = each.usual;
    config.assumed.push_back(each.key);
    config.friction_is_assumed |= decides;
  }
}

}  // namespace

estimator::ConstantSet left_out_constants(const TomlNode& root,
                                          const std::vector<std::string>& model_keys) {
  const TomlNode* stated = section_of(root, "variator");
  estimator::ConstantSet out;
  for (std::size_t i = 0; i < estimator::kConstantCount; ++i) {
    const std::string_view key = estimator::assumptions()[i].key;
    const bool in_model = std::find(model_keys.begin(), model_keys.end(), key) != model_keys.end();
    const bool in_file = stated != nullptr && stated->find(key) != nullptr;
    out.set(i, !in_model && !in_file);
  }
  return out;
}

void assume(const estimator::ConstantSet& left_out, SensorTexts& sensors, Config& config) {
  assume_constants(left_out, config);
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
    for (const LeftOut& each : left_out(role, sensors[i])) {
      result.stated[i].*each.value = each.usual;
      result.assumed.push_back({role, each.key, each.usual});
    }
  }
}

}  // namespace beltgrip::daemon
