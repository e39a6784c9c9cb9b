// The programs under test on the bus of the paper's rig: configuration, start, listening.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tests/system/vcan/published_frames.h"

namespace beltgrip::test {

// The program as built, "beltgrip" or "beltgripd".
std::string program(const std::string& name);

// Writes a configuration for the rig's frames (tools/scenarios/paper-rig.dbc), experiment from the
// first to the last sample, observe only; `more` is TOML text at its end. Returns its path.
std::string write_rig_config(const std::string& folder, const std::string& interface,
                             const std::string& more = "");
// Writes one second of the rig's frames at a steady operating point, without macro-slip, as a
// candump log of vcan0. Returns its path.
std::string write_steady_log(const std::string& folder);
// The same on a full bus: 4,000 frames a second, all others with identifiers that nobody asked for.
std::string write_full_log(const std::string& folder);

// canplayer, playing a log of vcan0 to `interface`, once or for ever.
std::vector<std::string> canplayer(const std::string& log, const std::string& interface,
                                   bool for_ever = false);

// Takes frames from the bus until `done` says so; false at the limit.
bool listen(const BusSocket& bus, PublishedFrames& published,
            const std::function<bool(const PublishedFrames&)>& done, Milliseconds limit = kLimit);

}  // namespace beltgrip::test
