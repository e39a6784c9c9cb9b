// The frames of this car (big-endian, other identifiers, protected) with the DBC file that tells
// them, and those of BeltGrip, read by the published layout.
#pragma once

#include <linux/can.h>

#include <cstdint>
#include <string>
#include <vector>

namespace beltgrip::other {

using Bytes = std::vector<std::uint8_t>;

// CRC-8 of AUTOSAR E2E profile 1, variant 1A: what byte 0 of a frame must be.
std::uint8_t protection(std::uint16_t data_id, const Bytes& frame);

struct Field {
  const char* name;
  int start;  // as in a DBC: the highest bit
  int length;
  double factor, offset;
  bool is_signed;
  const char* unit;
};

struct Message {
  const char* name;
  canid_t id;  // with CAN_EFF_FLAG where it is 29 bit
  int cycle_ms;
  std::uint16_t data_id;
  std::vector<Field> fields;  // beside checksum (byte 0) and counter (low nibble of byte 1)
};

// Shafts, Hydraulics, Motor, Chassis.
enum MessageIndex { kShafts, kHydraulics, kMotor, kChassis, kMessages };
const std::vector<Message>& messages();

Bytes encode(const Message& message, int counter, const std::vector<double>& values);
std::string dbc_text();
std::string configuration_text(const std::string& trigger);

// Identifiers that BeltGrip is told to use; its data ids stay those of its defaults.
inline constexpr canid_t kEstimateId = 0x5B0, kSlipId = 0x5B1, kClampId = 0x5B2, kStatusId = 0x5B3;
inline constexpr std::uint16_t kEstimateDataId = 0x6A0;

// What the configuration says and the account holds BeltGrip to.
inline constexpr double kPause_s = 1.5;
inline constexpr double kRateMax_N_per_s = 600.0;
inline constexpr double kFloor_Pa = 60e3;

// Little-endian bits of a frame of BeltGrip.
std::uint64_t bits(const Bytes& frame, int start, int length);

}  // namespace beltgrip::other
