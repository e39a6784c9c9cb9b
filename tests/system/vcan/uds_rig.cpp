#include "tests/system/vcan/uds_rig.h"

#include <fstream>
#include <sstream>

namespace beltgrip::test {

std::string take_pressure_from_uds(const std::string& path, bool polls) {
  std::stringstream text;
  text << std::ifstream(path).rdbuf();
  std::string toml = text.str();
  const std::string role = "\"RIG_Pressure.SecondaryPressure\"";
  toml.replace(toml.find(role), role.size(),
               "{ uds = { request = 0x7E1, response = 0x7E9, did = 0x1101, start = 0, length = "
               "16, byte_order = \"little\", scale = 0.001 }, unit = \"bar\", period_ms = 50, "
               "bus = \"diag\" }");
  toml.insert(toml.find("[signals]"), std::string(polls ? "diagnostics = \"poll\"\n" : "") +
                                          "[bus.diag]\ninterface = \"vcan1\"\n");
  std::ofstream(path) << toml;
  return path;
}

bool is_set(const PublishedFrames& published, const char* fault) {
  const auto status = published.last("BeltGripStatus").signals;
  return !status.empty() && status.at(fault) != 0;
}

bool pressure_valid(const PublishedFrames& published) {
  constexpr double kNotAvailable = -0.32768;
  const auto slip = published.last("BeltGripSlip").signals;
  return !slip.empty() && slip.at("MuStar") > kNotAvailable + 5e-6;
}

}  // namespace beltgrip::test
