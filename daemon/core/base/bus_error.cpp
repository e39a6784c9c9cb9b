#include "daemon/core/base/bus_error.h"

namespace beltgrip::daemon {

namespace {
// Classes, in the identifier.
constexpr std::uint32_t kController = 0x004;
constexpr std::uint32_t kBusOff = 0x040;
constexpr std::uint32_t kRestarted = 0x100;
// Details of kController, in byte 1.
constexpr unsigned kWarningBits = 0x04 | 0x08;
constexpr unsigned kPassiveBits = 0x10 | 0x20;
constexpr unsigned kActiveBit = 0x40;
}  // namespace

std::optional<BusState> bus_state_of(const can::CanFrame& error_frame) noexcept {
  if (!error_frame.error) return {};
  const std::uint32_t classes = error_frame.id.value;
  if ((classes & kBusOff) != 0) return BusState::kOff;
  if ((classes & kRestarted) != 0) return BusState::kActive;
  if ((classes & kController) == 0 || error_frame.length < 2) return {};
  const unsigned details = error_frame.data[1];
  if ((details & kPassiveBits) != 0) return BusState::kPassive;
  if ((details & kWarningBits) != 0) return BusState::kWarning;
  if ((details & kActiveBit) != 0) return BusState::kActive;
  return {};
}

}  // namespace beltgrip::daemon
