#include "daemon/core/config/load/config_checks.h"

#include "daemon/core/config/options/option_reader.h"

namespace beltgrip::daemon {

void check_required_roles(const Config& config, const TomlNode& root, ConfigErrors& errors) {
  const TomlNode* signals = section_of(root, "signals");
  const auto named = [&](Role role) {
    return signals != nullptr && signals->find(role_name(role)) != nullptr;
  };
  const std::uint32_t line = signals == nullptr ? 1 : signals->line;
  const auto require = [&](Role role, const std::string& expected) {
    errors.add(line, key_of("signals", role_name(role)), "no such key", expected);
  };
  for (const Role role : {Role::kPrimarySpeed, Role::kSecondarySpeed, Role::kSecondaryPressure}) {
    if (!named(role)) require(role, "a signal: \"Message.Signal\"");
  }
  if (!named(Role::kEngineTorque) && !named(Role::kPrimaryTorque)) {
    require(Role::kEngineTorque, "a signal: \"Message.Signal\", here or as primary_torque");
  }
  if (config.trigger == Trigger::kSignal && !named(Role::kExperimentActive)) {
    require(Role::kExperimentActive, "a signal, as experiment.trigger is \"signal\"");
  }
  if (config.control != Control::kCommand) return;
  for (const Role role : {Role::kExperimentPermitted, Role::kAcceleratorPedal, Role::kBrakePressed,
                          Role::kLockupClosed, Role::kOilTemperature, Role::kVehicleSpeed}) {
    if (!named(role)) require(role, "a signal, as experiment.control is \"command\"");
  }
}

void check_numbers(const Config& config, const TomlNode& root, ConfigErrors& errors) {
  const auto wrong = [&](std::string_view section, std::string_view key, const std::string& found,
                         const std::string& expected) {
    errors.add(line_of(root, section, key), key_of(section, key), found, expected);
  };
  const estimator::VariatorParameters& variator = config.variator;
  if (variator.ratio_low >= variator.ratio_overdrive) {
    wrong("variator", "ratio_low", value_text(variator.ratio_low),
          "less than ratio_overdrive, " + value_text(variator.ratio_overdrive));
  }
  if (variator.primary_radius_low_m >= variator.primary_radius_overdrive_m) {
    wrong(
        "variator", "primary_radius_low_m", value_text(variator.primary_radius_low_m),
        "less than primary_radius_overdrive_m, " + value_text(variator.primary_radius_overdrive_m));
  }
  const estimator::EstimatorSettings& settings = config.estimator;
  if (settings.stop_slope >= settings.peak_slope) {
    wrong("estimator", "stop_slope", value_text(settings.stop_slope),
          "less than peak_slope, " + value_text(settings.peak_slope));
  }
  if (settings.lowpass_hz >= settings.sample_rate_hz / 2.0) {
    wrong("estimator", "lowpass_hz", value_text(settings.lowpass_hz),
          "less than half of sample_rate_hz, " + value_text(settings.sample_rate_hz / 2.0));
  }
  if (settings.method == estimator::Method::kPaper &&
      settings.stop_rule == estimator::StopRule::kConfidence) {
    wrong("experiment", "stop", "\"confidence\"",
          "\"peak\", as estimator.method is \"paper\": it has no interval before the peak");
  }
}

void check_command(const Config& config, const TomlNode& root, ConfigErrors& errors) {
  if (config.control != Control::kCommand) return;
  if (config.trigger != Trigger::kCoastDown && config.trigger != Trigger::kSteady) {
    errors.add(line_of(root, "experiment", "trigger"), "experiment.trigger",
               config.trigger == Trigger::kSignal ? "\"signal\"" : "\"always\"",
               "\"coast_down\" or \"steady\", as experiment.control is \"command\"");
  }
  if (config.variator.primary_inertia_kg_m2 <= 0.0) {
    errors.add(line_of(root, "variator", "primary_inertia_kg_m2"), "variator.primary_inertia_kg_m2",
               value_text(config.variator.primary_inertia_kg_m2),
               "the inertia, as experiment.control is \"command\": the slip limits rest on it");
  }
}

}  // namespace beltgrip::daemon
