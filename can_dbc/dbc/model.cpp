#include "can_dbc/dbc/model.h"

namespace beltgrip::can {

const SignalDef* MessageDef::find_signal(std::string_view signal_name) const {
  for (const auto& signal : signals) {
    if (signal.name == signal_name) return &signal;
  }
  return nullptr;
}

const MessageDef* Database::find_message(std::string_view message_name) const {
  for (const auto& message : messages) {
    if (message.name == message_name) return &message;
  }
  return nullptr;
}

const MessageDef* Database::find_message(CanId id) const {
  for (const auto& message : messages) {
    if (message.id == id) return &message;
  }
  return nullptr;
}

std::string value_key_text(const SignalDef& signal, std::int64_t key) {
  const bool unsigned_64 = signal.type == ValueType::kUnsigned && signal.length == 64;
  return unsigned_64 ? std::to_string(static_cast<std::uint64_t>(key)) : std::to_string(key);
}

}  // namespace beltgrip::can
