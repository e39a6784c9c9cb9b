#include "tools/cli/dbc_encode.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>

#include "can_dbc/dbc/message_codec.h"
#include "can_dbc/log/candump_writer.h"
#include "can_dbc/text/number_text.h"
#include "can_dbc/text/printable.h"
#include "tools/cli/dbc_file.h"
#include "tools/cli/failure.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

// A physical value stands for the nearest raw one: farther than half a step it has none.
constexpr double kHalfStep = 0.5;
constexpr double kRounding = 1e-9;  // of the value: what two rounded operations leave
constexpr double kFloat32 = 1e-6;   // of the value: more than a step of 32-bit floats

struct Given {
  std::size_t index = 0;  // of the signal
  std::uint64_t raw = 0;
};

[[noreturn]] void refuse(const std::string& text) { throw Failure{kUsage, text}; }

std::string names_of(const std::vector<can::SignalDef>& signals) {
  std::string names;
  for (const can::SignalDef& signal : signals) names += (names.empty() ? "" : ", ") + signal.name;
  return names;
}

std::optional<double> number(const std::string& text) {
  double value = 0.0;
  const char* end = text.data() + text.size();
  const auto [stopped, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc{} || stopped != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<std::uint64_t> labelled(const can::SignalDef& signal, const std::string& text) {
  for (const auto& [key, label] : signal.values) {
    if (label == text) return static_cast<std::uint64_t>(key);
  }
  return std::nullopt;
}

// What a floating-point signal carries besides numbers, as dbc decode writes it.
std::optional<std::uint64_t> no_number(const can::SignalDef& signal, const std::string& text) {
  const bool is_double = signal.type == can::ValueType::kFloat64;
  if (!is_double && signal.type != can::ValueType::kFloat32) return std::nullopt;
  double value = std::numeric_limits<double>::infinity();
  if (text == "nan") {
    value = std::numeric_limits<double>::quiet_NaN();
  } else if (text == "-inf") {
    value = -value;
  } else if (text != "inf") {
    return std::nullopt;
  }
  if (is_double) return std::bit_cast<std::uint64_t>(value);
  return std::bit_cast<std::uint32_t>(static_cast<float>(value));
}

std::uint64_t raw_of(const can::SignalDef& signal, const can::SignalCodec& codec,
                     const std::string& text) {
  if (const auto raw = labelled(signal, text)) return *raw & codec.mask();
  if (const auto raw = no_number(signal, text)) return *raw;
  const std::optional<double> value = number(text);
  if (!value) {
    refuse(signal.name + ": found \"" + text + "\", expected a number" +
           (signal.values.empty() ? "" : " or a text of its value table"));
  }
  const std::uint64_t raw = codec.raw_from_physical(*value);
  const double carried = codec.physical(raw);
  const double allowed =
      std::abs(*value) * (codec.is_float() ? kFloat32 : kRounding) +
      (codec.is_float() ? 0.0 : kHalfStep * std::abs(signal.scale) * (1.0 + kRounding));
  if (!(std::abs(carried - *value) <= allowed)) {
    refuse(signal.name + ": found " + text + ", which its " + std::to_string(signal.length) +
           " bits cannot carry; the nearest is " + number_text(carried));
  }
  return raw & codec.mask();
}

std::uint64_t start_value(const can::SignalDef& signal, const can::SignalCodec& codec) {
  const auto stated = signal.attributes.find("GenSigStartValue");
  if (stated == signal.attributes.end()) return 0;
  const double raw = number(stated->second).value_or(0.0);
  // The attribute is the raw value as a number.
  return codec.raw_from_physical(raw * signal.scale + signal.offset) & codec.mask();
}

class Encoder {
 public:
  explicit Encoder(const can::MessageDef& message)
      : message_(message), codec_(message), decoded_(message.signals.size()) {
    frame_.id = message.id;
    frame_.fd = message.fd;
    frame_.length = static_cast<std::uint8_t>(message.length);
  }

  void take(const std::string& text) {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos) refuse(text + ": expected SIGNAL=VALUE");
    const std::string name = text.substr(0, equals);
    const auto& signals = message_.signals;
    const auto found = std::find_if(signals.begin(), signals.end(),
                                    [&](const auto& signal) { return signal.name == name; });
    if (found == signals.end()) {
      refuse(name + ": no signal of " + message_.name + ", which has " + names_of(signals));
    }
    const auto index = static_cast<std::size_t>(found - signals.begin());
    if (is_given(index)) refuse(name + ": given twice");
    if (!codec_.signal(index).fits(frame_.length)) {
      refuse(name + ": lies outside the " + std::to_string(message_.length) + " bytes of " +
             message_.name);
    }
    given_.push_back({index, raw_of(*found, codec_.signal(index), text.substr(equals + 1))});
  }

  can::CanFrame frame() {
    // Selectors first: what is not given takes its start value only where it is selected.
    for (const bool multiplexed : {false, true}) {
      put_given();
      codec_.decode(frame_.payload(), decoded_);
      for (std::size_t i = 0; i < message_.signals.size(); ++i) {
        const can::SignalDef& signal = message_.signals[i];
        if ((signal.multiplexed_by != nullptr) != multiplexed || !decoded_.has(i)) continue;
        if (!is_given(i)) put(i, start_value(signal, codec_.signal(i)));
      }
    }
    put_given();
    codec_.decode(frame_.payload(), decoded_);
    for (const Given& each : given_) check(each);
    return frame_;
  }

 private:
  bool is_given(std::size_t index) const {
    return std::any_of(given_.begin(), given_.end(),
                       [&](const Given& each) { return each.index == index; });
  }

  void put(std::size_t index, std::uint64_t raw) {
    codec_.signal(index).insert(std::span(frame_.data).first(frame_.length), raw);
  }
  void put_given() {
    for (const Given& each : given_) put(each.index, each.raw);
  }

  void check(const Given& given) const {
    const can::SignalDef& signal = message_.signals[given.index];
    if (!decoded_.has(given.index)) {
      const std::string selector =
          signal.multiplexed_by ? signal.multiplexed_by->selector : "its multiplexer";
      refuse(signal.name + ": not in a frame with this value of " + selector);
    }
    if ((decoded_[given.index].raw & codec_.signal(given.index).mask()) != given.raw) {
      refuse(signal.name + ": shares bits with another signal that is given");
    }
  }

  const can::MessageDef& message_;
  can::MessageCodec codec_;
  can::DecodedMessage decoded_;
  std::vector<Given> given_;
  can::CanFrame frame_;
};

}  // namespace

void encode(const EncodeOptions& options) {
  for (const std::string& path : options.dbc_paths) {
    const can::DbcParseResult file = read_dbc(path);
    mention_problems(path, file.problems);
    if (file.database.messages.empty()) fail_without_message(path);
    const can::MessageDef* message = file.database.find_message(options.message);
    if (message == nullptr) continue;
    if (message->length > (message->fd ? can::kMaxPayload : 8)) {
      throw Failure{kBadInput, path + ": " + message->name + ": found " +
                                   std::to_string(message->length) +
                                   " bytes, more than a frame has"};
    }
    Encoder encoder(*message);
    for (const std::string& value : options.values) encoder.take(value);
    text::print(stdout, can::frame_text(encoder.frame()) + "\n");
    return;
  }
  refuse(options.message + ": no message of that name");
}

}  // namespace beltgrip::cli
