#include "daemon/core/config/load/config_fingerprint.h"

#include "can_dbc/text/number_text.h"
#include "daemon/core/config/options/config_model.h"
#include "daemon/core/config/options/config_options.h"

namespace beltgrip::daemon {

namespace {

// The margins of MinClampForce are not part of a measurement.
bool decides(const Option& option) {
  return option.section == "variator" && option.kind == Option::Kind::kNumber &&
         option.key != "safety_factor" && option.key != "torque_reserve_Nm";
}

}  // namespace

std::string config_fingerprint(const Config& config) {
  std::string text;
  Config copy = config;
  for (const Option& option : option_table()) {
    if (!decides(option)) continue;
    text += std::string(option.key) + '=' + number_text(option.number(copy)) + ';';
  }
  text += config.estimator.method == estimator::Method::kPaper ? "paper;" : "robust;";
  // The same number is another measurement where it is only assumed.
  for (const std::string& key : config.assumed) {
    if (key.starts_with("variator.")) text += "assumed " + key + ';';
  }
  // Requests are made, and read, at the defaults of what is assumed; else it is read in its middle.
  if (config.assumed_constants.any() && config.control == Control::kCommand) {
    text += "read at the defaults;";
  }
  if (config.corrected) {
    for (const estimator::EffectRow& key : estimator::effect_rows()) {
      // Nothing that lies behind the belt enters what is measured.
      if (key.value == nullptr || key.stage == estimator::Stage::kSecondaryShaft) continue;
      text += std::string(key.id) + '.' + std::string(key.parameter) + '=' +
              number_text((*config.corrected).*key.value) + ';';
    }
  }
  for (const estimator::LearnedTerm& each : config.learned) {
    text += "learned " + std::to_string(static_cast<int>(each.point)) + ' ' +
            std::to_string(static_cast<int>(each.variable));
    for (std::size_t i = 0; i < each.count; ++i) {
      text += ' ' + number_text(each.knot[i]) + '=' + number_text(each.value[i]);
    }
    text += ';';
  }
  for (const RoleBinding& role : config.roles) {
    if (!sensor_of(role.role)) continue;  // nothing is measured from it
    text += std::string(role_name(role.role)) + '=' + role.message_name + '.' + role.signal_name +
            '*' + number_text(role.factor) + '+' + number_text(role.shift) + ';';
    if (role.delay_ms != 0.0) text += "delay=" + number_text(role.delay_ms) + ';';
  }
  // FNV-1a, 64 bit.
  std::uint64_t hash = 0xCBF29CE484222325U;
  for (const char c : text) {
    hash ^= static_cast<unsigned char>(c);
    hash *= 0x100000001B3U;
  }
  constexpr std::string_view kHex = "0123456789abcdef";
  std::string digits;
  for (int shift = 60; shift >= 0; shift -= 4) digits += kHex[hash >> shift & 15U];
  return digits;
}

}  // namespace beltgrip::daemon
