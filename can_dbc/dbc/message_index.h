// Which message of one or several DBC files a received frame is: by its identifier or, in J1939 and
// NMEA 2000 files, by its parameter group. Built at start-up; lookup is noexcept, allocation-free
// and takes the same time however many messages there are.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "can_dbc/dbc/model.h"

namespace beltgrip::can {

// The parameter group number of a 29-bit identifier: below PDU format 240 the next byte is the
// destination address and does not count (SAE J1939-21).
constexpr bool has_destination(std::uint32_t id) noexcept {
  constexpr std::uint32_t kFirstBroadcastFormat = 240;
  return ((id >> 16) & 0xFFU) < kFirstBroadcastFormat;
}
constexpr std::uint32_t parameter_group(std::uint32_t id) noexcept {
  return (id >> 8) & (has_destination(id) ? 0x3FF00U : 0x3FFFFU);
}

// The bits of a received identifier of the same kind (11 or 29 bits) that must equal those of the
// message's: all of them, or those of the parameter group. Also the mask of a kernel filter.
constexpr std::uint32_t identifier_mask(CanId id, bool j1939) noexcept {
  if (!id.extended) return kStandardIdMax;
  if (!j1939) return kExtendedIdMax;
  return has_destination(id.value) ? 0x03FF'0000U : 0x03FF'FF00U;
}

constexpr bool is_of_message(CanId received, CanId message, bool j1939) noexcept {
  return received.extended == message.extended &&
         ((received.value ^ message.value) & identifier_mask(message, j1939)) == 0;
}

class MessageIndex {
 public:
  struct Entry {
    std::uint32_t database = 0;  // index of the file
    std::uint32_t message = 0;   // index of the message in it
    friend bool operator==(const Entry&, const Entry&) = default;
  };
  // Two files that define the same identifier, or the same parameter group from the same source.
  struct Conflict {
    Entry used;
    Entry ignored;
  };

  MessageIndex() = default;
  // Where messages compete, the first file and in it the first message is used.
  explicit MessageIndex(std::span<const Database* const> databases);

  // The message of a frame with this identifier; nullptr if there is none. An exact identifier
  // wins, then the parameter group from the same source address, then the group from any source.
  const Entry* lookup(CanId id) const noexcept;
  // Before it is looked up.
  void bring_near(CanId id) const noexcept;
  const std::vector<Conflict>& conflicts() const noexcept { return conflicts_; }

 private:
  enum class Kind : std::uint64_t { kIdentifier = 1, kGroupAndSource = 2, kGroup = 3 };
  static constexpr std::uint32_t kEmpty = ~std::uint32_t{0};
  struct Slot {
    std::uint64_t key = 0;
    std::uint32_t entry = kEmpty;  // in entries_
  };

  static std::uint64_t key_of(Kind kind, std::uint32_t value) noexcept {
    return (static_cast<std::uint64_t>(kind) << 32) | value;
  }
  std::size_t first_slot_of(std::uint64_t key) const noexcept;
  std::size_t slot_of(std::uint64_t key) const noexcept;
  const Entry* find(std::uint64_t key) const noexcept;
  // False if the key was taken; the entry that has it stays.
  bool insert(std::uint64_t key, std::uint32_t entry);
  void insert_message(const MessageDef& message, std::uint32_t entry);

  std::vector<Entry> entries_;
  std::vector<std::uint32_t> standard_;  // entry of each 11-bit identifier
  std::vector<Slot> slots_;              // a power of two, at most half full
  std::vector<Conflict> conflicts_;
};

}  // namespace beltgrip::can
