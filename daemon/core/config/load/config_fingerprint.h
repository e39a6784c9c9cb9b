// A short name for everything in the configuration that decides what mu_max comes out of the same
// frames: variator, method, and the signals that it rests on. Results under different fingerprints
// are not compared. Start-up only.
#pragma once

#include <string>

#include "daemon/core/config/options/config.h"

namespace beltgrip::daemon {

std::string config_fingerprint(const Config& config);  // 16 hexadecimal digits

}  // namespace beltgrip::daemon
