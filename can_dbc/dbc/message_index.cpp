#include "can_dbc/dbc/message_index.h"

#include <bit>

#include "can_dbc/dbc/bring_near.h"

namespace beltgrip::can {

namespace {
constexpr std::uint32_t kSourceMask = 0xFF;
constexpr std::uint32_t kNullSource = 0xFE;  // what a DBC writes for "any source"
}  // namespace

MessageIndex::MessageIndex(std::span<const Database* const> databases)
    : standard_(kStandardIdMax + 1, kEmpty) {
  std::size_t extended = 0;
  for (const Database* database : databases) {
    for (const MessageDef& message : database->messages) extended += message.id.extended ? 1 : 0;
  }
  constexpr std::size_t kKeysPerMessage = 3;
  slots_.resize(std::bit_ceil(2 * kKeysPerMessage * extended + 1));

  for (std::uint32_t database = 0; database < databases.size(); ++database) {
    const std::vector<MessageDef>& messages = databases[database]->messages;
    for (std::uint32_t message = 0; message < messages.size(); ++message) {
      entries_.push_back({database, message});
      insert_message(messages[message], static_cast<std::uint32_t>(entries_.size() - 1));
    }
  }
  // The group alone: a message from the null address stands for every source, before all others.
  for (const bool null_source : {true, false}) {
    for (std::uint32_t entry = 0; entry < entries_.size(); ++entry) {
      const MessageDef& message =
          databases[entries_[entry].database]->messages[entries_[entry].message];
      if (!message.j1939 || !message.id.extended) continue;
      if (((message.id.value & kSourceMask) == kNullSource) != null_source) continue;
      insert(key_of(Kind::kGroup, parameter_group(message.id.value)), entry);
    }
  }
}

void MessageIndex::insert_message(const MessageDef& message, std::uint32_t entry) {
  const auto conflict_with = [&](const Entry& used) {
    // Within one file it is a warning of that file.
    if (used.database != entries_[entry].database) conflicts_.push_back({used, entries_[entry]});
  };
  const std::uint32_t id = message.id.value;
  if (!message.id.extended) {
    if (id > kStandardIdMax) return;
    if (standard_[id] == kEmpty) {
      standard_[id] = entry;
    } else {
      conflict_with(entries_[standard_[id]]);
    }
    return;
  }
  const std::uint64_t exact = key_of(Kind::kIdentifier, id);
  const bool is_new = insert(exact, entry);
  if (!is_new) conflict_with(*find(exact));
  if (!message.j1939) return;
  const std::uint64_t group =
      key_of(Kind::kGroupAndSource, (parameter_group(id) << 8) | (id & kSourceMask));
  if (!insert(group, entry) && is_new) conflict_with(*find(group));
}

std::size_t MessageIndex::first_slot_of(std::uint64_t key) const noexcept {
  // Multiplicative hashing: the high bits of the product with 2^64 / golden ratio.
  constexpr std::uint64_t kMultiplier = 0x9E37'79B9'7F4A'7C15U;
  const int bits = std::countr_zero(slots_.size());
  return bits == 0 ? 0 : static_cast<std::size_t>((key * kMultiplier) >> (64 - bits));
}

std::size_t MessageIndex::slot_of(std::uint64_t key) const noexcept {
  std::size_t slot = first_slot_of(key);
  while (slots_[slot].entry != kEmpty && slots_[slot].key != key) {
    slot = (slot + 1) & (slots_.size() - 1);
  }
  return slot;
}

const MessageIndex::Entry* MessageIndex::find(std::uint64_t key) const noexcept {
  const Slot& slot = slots_[slot_of(key)];
  return slot.entry == kEmpty ? nullptr : &entries_[slot.entry];
}

bool MessageIndex::insert(std::uint64_t key, std::uint32_t entry) {
  Slot& slot = slots_[slot_of(key)];
  if (slot.entry != kEmpty) return false;
  slot = {key, entry};
  return true;
}

void MessageIndex::bring_near(CanId id) const noexcept {
  if (!id.extended || entries_.empty()) return;  // of 11 bits they are few
  can::bring_near(&slots_[first_slot_of(key_of(Kind::kIdentifier, id.value))], sizeof(Slot));
}

const MessageIndex::Entry* MessageIndex::lookup(CanId id) const noexcept {
  if (entries_.empty()) return nullptr;
  if (!id.extended) {
    if (id.value > kStandardIdMax || standard_[id.value] == kEmpty) return nullptr;
    return &entries_[standard_[id.value]];
  }
  if (const Entry* entry = find(key_of(Kind::kIdentifier, id.value))) return entry;
  const std::uint32_t group = parameter_group(id.value);
  const std::uint32_t group_and_source = (group << 8) | (id.value & kSourceMask);
  if (const Entry* entry = find(key_of(Kind::kGroupAndSource, group_and_source))) return entry;
  return find(key_of(Kind::kGroup, group));
}

}  // namespace beltgrip::can
