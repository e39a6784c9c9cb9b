// The rig with its pressure from diagnostics: one ECU on a second interface, identifier 0x1101.
#pragma once

#include <string>

#include "tests/system/vcan/rig.h"

namespace beltgrip::test {

inline constexpr canid_t kUdsRequest = 0x7E1, kUdsAnswer = 0x7E9;

// Changes the configuration of write_rig_config at `path`: the pressure is two bytes, low one
// first, in mbar, of the data of 0x1101 on vcan1, asked for every 50 ms when `polls`. Returns
// `path`.
std::string take_pressure_from_uds(const std::string& path, bool polls);

bool is_set(const PublishedFrames& published, const char* fault);
// Traction is known, so the pressure is.
bool pressure_valid(const PublishedFrames& published);

}  // namespace beltgrip::test
