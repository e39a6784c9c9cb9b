#include "daemon/io/link_health.h"

#include "daemon/io/can_link.h"

namespace beltgrip::daemon {

std::string link_health(const std::string& interface) {
  const std::string line = "controller of " + interface + ": ";
  const Result<CanLink> read = read_can_link(interface);
  if (!read) return line + "unknown (" + read.error() + ")";
  const CanLink& link = *read;
  if (!link.has_controller) return line + "unknown (a virtual interface has none)";
  if (!link.state) return line + "unknown (it does not say)";
  std::string said = line + std::string(*link.state);
  if (link.bitrate) said += ", " + std::to_string(*link.bitrate) + " bit/s";
  return said;
}

}  // namespace beltgrip::daemon
