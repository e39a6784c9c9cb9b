#include "tests/system/vcan/other_vehicle/frames.h"

#include <cmath>
#include <sstream>

#include "tests/system/vcan/other_vehicle/car.h"

namespace beltgrip::other {

std::uint8_t protection(std::uint16_t data_id, const Bytes& frame) {
  unsigned crc = 0;
  const auto take = [&](unsigned byte) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 0x80U) ? (crc << 1 ^ 0x1DU) & 0xFFU : crc << 1;
  };
  take(data_id & 0xFFU);
  take(data_id >> 8);
  for (std::size_t i = 1; i < frame.size(); ++i) take(frame[i]);
  return static_cast<std::uint8_t>(crc);
}

const std::vector<Message>& messages() {
  static const std::vector<Message> all = {
      {"Shafts",
       0x0C5,
       10,
       0x2C51,
       {{"PulleyIn", 23, 16, 0.1, 0.0, false, "rpm"},
        {"PulleyOut", 39, 16, 0.1, 0.0, false, "rpm"}}},
      {"Hydraulics",
       0x18F0A103 | CAN_EFF_FLAG,
       10,
       0x2C52,
       {{"OutPulleyPressure", 23, 16, 0.2, -100.0, false, "kPa"},
        {"OilTemperature", 39, 8, 1.0, -40.0, false, "degC"},
        {"Clutch", 47, 2, 1.0, 0.0, false, ""},
        {"TestAllowed", 45, 1, 1.0, 0.0, false, ""}}},
      {"Motor",
       0x2B1,
       10,
       0x2C53,
       {{"ShaftTorque", 23, 16, 0.05, 0.0, true, "Nm"},
        {"CrankSpeed", 39, 16, 0.1, 0.0, false, "rpm"},
        {"Pedal", 55, 8, 0.4, 0.0, false, "%"}}},
      {"Chassis",
       0x3D2,
       20,
       0x2C54,
       {{"RoadSpeed", 23, 16, 0.01, 0.0, false, "km/h"},
        {"BrakeLamp", 39, 1, 1.0, 0.0, false, ""}}},
  };
  return all;
}

Bytes encode(const Message& message, int counter, const std::vector<double>& values) {
  Bytes frame(8, 0);
  frame[1] = static_cast<std::uint8_t>(counter);
  for (std::size_t i = 0; i < message.fields.size(); ++i) {
    const Field& field = message.fields[i];
    const auto raw =
        static_cast<std::uint64_t>(std::llround((values.at(i) - field.offset) / field.factor));
    int at = field.start;
    for (int bit = field.length - 1; bit >= 0; --bit) {
      const auto byte = static_cast<std::size_t>(at / 8);
      frame[byte] = static_cast<std::uint8_t>(frame[byte] | (raw >> bit & 1U) << (at % 8));
      at = at % 8 == 0 ? at + 15 : at - 1;
    }
  }
  frame[0] = protection(message.data_id, frame);
  return frame;
}

std::string dbc_text() {
  std::ostringstream text;
  text << "VERSION \"\"\nNS_ :\nBS_:\nBU_: Gearbox Listener\n";
  for (const Message& message : messages()) {
    text << "BO_ " << message.id << " " << message.name << ": 8 Gearbox\n"
         << " SG_ Checksum : 7|8@0+ (1,0) [0|255] \"\" Listener\n"
         << " SG_ Rolling : 11|4@0+ (1,0) [0|14] \"\" Listener\n";
    for (const Field& f : message.fields) {
      text << " SG_ " << f.name << " : " << f.start << "|" << f.length << "@0"
           << (f.is_signed ? "-" : "+") << " (" << f.factor << "," << f.offset << ") [0|0] \""
           << f.unit << "\" Listener\n";
    }
  }
  text << "BA_DEF_ BO_ \"GenMsgCycleTime\" INT 0 65535;\nBA_DEF_DEF_ \"GenMsgCycleTime\" 0;\n";
  for (const Message& message : messages()) {
    text << "BA_ \"GenMsgCycleTime\" BO_ " << message.id << " " << message.cycle_ms << ";\n";
  }
  text << "VAL_ " << messages()[kHydraulics].id
       << " Clutch 0 \"Open\" 1 \"Sliding\" 2 \"Shut\" ;\n";
  return text.str();
}

std::string configuration_text(const std::string& trigger) {
  std::ostringstream text;
  text << "[bus]\ninterface = \"vcan0\"\ndbc = [\"other.dbc\"]\nidentifiers = { estimate = "
       << kEstimateId << ", slip = " << kSlipId << ", clamp = " << kClampId
       << ", status = " << kStatusId << " }\n"
       << R"([signals]
primary_speed = "Shafts.PulleyIn"
secondary_speed = "Shafts.PulleyOut"
secondary_pressure = "0x18F0A103x.OutPulleyPressure"
oil_temperature = "Hydraulics.OilTemperature"
lockup_closed = { signal = "Hydraulics.Clutch", true_when = "Shut" }
experiment_permitted = "Hydraulics.TestAllowed"
engine_torque = "0x2B1.ShaftTorque"
engine_speed = "Motor.CrankSpeed"
accelerator_pedal = "Motor.Pedal"
vehicle_speed = "Chassis.RoadSpeed"
brake_pressed = "Chassis.BrakeLamp"
[sensors]
primary_speed = { bias_rad_s = 0.0, gain = 0.0 }
secondary_speed = { bias_rad_s = 0.0, gain = 0.0 }
secondary_pressure = { bias_Pa = 2e3, gain = 0.002 }
engine_torque = { bias_Nm = 0.3, gain = 0.005 }
[protection]
)";
  for (const Message& message : messages()) {
    text << message.name
         << " = { counter = \"Rolling\", counter_max = 14, crc = \"Checksum\", data_id = "
         << message.data_id << " }\n";
  }
  text << "[variator]\nhalf_wedge_angle_deg = " << kHalfWedge_deg
       << "\nratio_overdrive = " << kRatioOverdrive
       << "\nprimary_radius_overdrive_m = " << kPrimaryRadius_m
       << "\nprimary_radius_low_m = 0.0331\nsecondary_piston_area_m2 = " << kPistonArea_m2
       << "\nsecondary_spring_force_N = " << kSpring_N
       << "\nsecondary_centrifugal_N_s2 = " << kCentrifugal_N_s2
       << "\nprimary_inertia_kg_m2 = " << kPrimaryInertia_kg_m2 << "\n[experiment]\ntrigger = \""
       << trigger << "\"\ncontrol = \"command\"\nramp_rate_max_N_per_s = " << kRateMax_N_per_s
       << "\nsecondary_pressure_floor_Pa = " << kFloor_Pa << "\ncooldown_s = " << kPause_s
       << "\ncooldown_m = 0.0"
       << "\nactuator_dead_time_s = 0.05\nactuator_lag_s = 0.1\nfall_max_per_percent = 4e-3\n";
  return text.str();
}

std::uint64_t bits(const Bytes& frame, int start, int length) {
  std::uint64_t value = 0;
  for (int i = 0; i < length; ++i) {
    const int at = start + i;
    const std::uint64_t bit = frame.at(static_cast<std::size_t>(at / 8)) >> (at % 8) & 1U;
    value |= bit << i;
  }
  return value;
}

}  // namespace beltgrip::other
