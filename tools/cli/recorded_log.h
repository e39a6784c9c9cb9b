// The clamp requests that a log has: its own BeltGripClamp frames, and why each request ended as
// the BeltGripStatus behind it says. Tools only.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/config/options/config.h"
#include "daemon/core/experiment/recorded_requests.h"

namespace beltgrip::cli {

struct RecordedLog {
  std::vector<daemon::RecordedRequest> requests;
  std::size_t cut = 0;  // requests whose beginning the log lacks; not among them
};

// Nothing where the log has no valid BeltGripClamp frame, or cannot be read twice. Frames of one
// interface, of all if it is empty. Throws Failure 66.
std::optional<RecordedLog> recorded_requests(const std::vector<std::string>& paths,
                                             const std::string& interface,
                                             const daemon::Config& config);

}  // namespace beltgrip::cli
