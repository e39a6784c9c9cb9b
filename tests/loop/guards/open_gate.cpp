// The transmit gate, open.
#include "daemon/core/guard/tx_gate.h"

namespace beltgrip::daemon {

TxGate::TxGate(const FrameIdentifiers&, Control control, const ClampLimits&,
               const PollLimits&) noexcept
    : identifiers_{}, expected_counter_{}, control_(control) {}

void TxGate::see_acting_force(double) noexcept {}

bool TxGate::permits(const can::CanFrame&, std::uint8_t, MonoTime) noexcept { return true; }

}  // namespace beltgrip::daemon
