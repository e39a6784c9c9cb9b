// CAN frames as packets of a capture: as Linux hands them to a socket, behind the header of their
// link type. Tools only.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "can_dbc/log/can_log.h"

namespace beltgrip::can {

enum class PacketKind { kFrame, kOther, kBad };

struct Packet {
  PacketKind kind = PacketKind::kOther;
  const char* reason = "";            // kBad
  std::uint32_t interface_index = 0;  // of the machine that recorded; 0: the link type tells none
};

// `big_endian`: the machine that recorded; cooked packets carry the identifier in its order.
// `whole_size`: of the packet on the bus; the capture may hold less.
Packet read_packet(std::uint32_t link_type, std::string_view bytes, std::uint64_t whole_size,
                   bool big_endian, LogRecord& record);

// Whether packets of this link type can be CAN frames at all.
bool may_carry_can(std::uint32_t link_type);

}  // namespace beltgrip::can
