#include "tools/cli/decoded_frame.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string_view>

#include "can_dbc/text/printable.h"
#include "tools/cli/failure.h"
#include "tools/text/json_writer.h"
#include "tools/text/short_number.h"

namespace beltgrip::cli {

namespace {

void append_number(std::string& line, auto value) {
  std::array<char, 32> text;
  line.append(text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr);
}

// Outside JSON nan, inf and -inf are told apart, and a nan has no sign.
double plain(double value) { return std::isnan(value) ? std::fabs(value) : value; }

// For people: a fraction without its last digits, which are of the binary number and not of the
// signal.
void append_readable(std::string& line, double value) {
  constexpr int kDigits = 12;
  if (value == std::trunc(value)) return append_number(line, value);
  std::array<char, 32> text;
  const auto end = std::to_chars(text.data(), text.data() + text.size(), plain(value),
                                 std::chars_format::general, kDigits);
  line.append(text.data(), end.ptr);
}

void append_value(std::string& line, double value, unsigned decimals) {
  std::array<char, text::kNumberLongest> text;
  line.append(text.data(), text::write_short(text.data(), value, decimals));
}

// Seconds with every digit that the log has, and no more zeros than needed.
void append_seconds(std::string& line, std::int64_t t_ns) {
  constexpr std::uint64_t kSecond_ns = 1'000'000'000;
  constexpr std::size_t kPlaces = 9;
  if (t_ns < 0) line += '-';
  const auto magnitude =
      t_ns < 0 ? ~static_cast<std::uint64_t>(t_ns) + 1 : static_cast<std::uint64_t>(t_ns);
  append_number(line, magnitude / kSecond_ns);
  auto fraction = static_cast<std::uint32_t>(magnitude % kSecond_ns);
  std::array<char, kPlaces + 1> text;
  text[0] = '.';
  for (std::size_t i = kPlaces; i > 0; --i, fraction /= 10) {
    text[i] = static_cast<char>('0' + fraction % 10);
  }
  std::size_t length = text.size();
  while (length > 2 && text[length - 1] == '0') --length;
  line.append(text.data(), length);
}

std::string json_text(std::string_view text) { return text::JsonWriter().value(text).take(); }

// Where the signal's value table has its value; nothing: nowhere, whatever the table.
std::optional<std::int64_t> table_key(const DecodedFrame& frame, std::size_t signal) {
  const can::SignalCodec& codec = frame.message.codec.signal(signal);
  const std::uint64_t raw = frame.values[signal].raw;
  if (!codec.is_float()) return static_cast<std::int64_t>(raw);
  const double value = codec.value_of(raw);
  constexpr double kExactWhole = 9007199254740992.0;  // 2^53
  if (!(std::fabs(value) <= kExactWhole) || value != std::trunc(value)) return std::nullopt;
  return static_cast<std::int64_t>(value);
}

class JsonFrames : public FrameWriter {
 public:
  explicit JsonFrames(bool with_raw) : with_raw_(with_raw) {}

  void append(const DecodedFrame& frame, std::string& out) override {
    const Texts& texts = texts_of(frame.message);
    out += R"({"t_s":)";
    append_seconds(out, frame.record.t_ns);
    out += R"(,"iface":)";
    append_interface(frame.record.interface, out);
    out += R"(,"id":)";
    append_number(out, frame.record.frame.id.value);
    out += texts.head;
    for_each_present(frame, texts, out, [&](std::size_t i) {
      const double value = frame.values[i].physical;
      if (std::isfinite(value)) {
        append_value(out, value, frame.message.decimals[i]);
      } else {
        out += "null";
      }
    });
    out += R"(},"labels":{)";
    append_labels(frame, texts, out);
    if (with_raw_) {
      out += R"(},"raw":{)";
      for_each_present(frame, texts, out, [&](std::size_t i) {
        out += '"';
        out += frame.message.codec.signal(i).raw_text(frame.values[i].raw);
        out += '"';
      });
    }
    out += "}}\n";
  }

 private:
  struct Label {
    std::int64_t key = 0;
    std::string member;  // "name":"text"
  };
  struct Labels {
    std::size_t signal = 0;
    std::vector<Label> of;  // by their keys
  };
  // What never changes of a message.
  struct Texts {
    std::string head;               // ,"extended":false,"message":"X","signals":{
    std::vector<std::string> keys;  // "name": of each signal
    std::vector<Labels> labels;     // of the signals that have any
  };

  const Texts& texts_of(const ChosenMessage& message) {
    if (message.number >= texts_.size()) texts_.resize(message.number + 1);
    Texts& texts = texts_[message.number];
    if (!texts.head.empty()) return texts;
    const can::MessageDef& definition = *message.definition;
    texts.head = R"(,"extended":)" + std::string(definition.id.extended ? "true" : "false") +
                 R"(,"message":)" + json_text(definition.name) + R"(,"signals":{)";
    for (const can::SignalDef& signal : definition.signals) {
      texts.keys.push_back(json_text(signal.name) + ':');
      if (signal.values.empty()) continue;
      texts.labels.push_back({texts.keys.size() - 1, {}});
      for (const auto& [key, text] : signal.values) {
        texts.labels.back().of.push_back({key, texts.keys.back() + json_text(text)});
      }
    }
    return texts;
  }

  static void append_labels(const DecodedFrame& frame, const Texts& texts, std::string& out) {
    bool first = true;
    for (const Labels& labels : texts.labels) {
      if (!frame.values.has(labels.signal)) continue;
      const std::optional<std::int64_t> key = table_key(frame, labels.signal);
      if (!key) continue;
      const auto found = std::lower_bound(
          labels.of.begin(), labels.of.end(), *key,
          [](const Label& label, std::int64_t wanted) { return label.key < wanted; });
      if (found == labels.of.end() || found->key != *key) continue;
      if (!first) out += ',';
      first = false;
      out += found->member;
    }
  }

  template <typename Write>
  static void for_each_present(const DecodedFrame& frame, const Texts& texts, std::string& out,
                               Write write) {
    bool first = true;
    frame.values.for_each_present([&](std::size_t i) {
      if (!first) out += ',';
      first = false;
      out += texts.keys[i];
      write(i);
    });
  }

  void append_interface(std::string_view interface, std::string& out) {
    if (interface != interface_) {
      interface_ = interface;
      interface_json_ = json_text(interface_);
    }
    out += interface_json_;
  }

  bool with_raw_;
  std::vector<Texts> texts_;
  std::string interface_;
  std::string interface_json_ = R"("")";
};

// 12.345 can0 0x123 Engine: Speed 97 rpm, Gear -1 (reverse)
class TextFrames : public FrameWriter {
 public:
  explicit TextFrames(bool with_raw) : with_raw_(with_raw) {}

  void append(const DecodedFrame& frame, std::string& out) override {
    const can::CanId id = frame.record.frame.id;
    std::string line;
    append_seconds(line, frame.record.t_ns);
    std::array<char, 16> id_text;
    std::snprintf(id_text.data(), id_text.size(), id.extended ? "0x%08" PRIX32 : "0x%03" PRIX32,
                  id.value);
    line += ' ';
    line += frame.record.interface;
    line += ' ';
    line += id_text.data();
    line += ' ';
    line += frame.message.definition->name;
    const char* before = ": ";
    frame.values.for_each_present([&](std::size_t i) {
      const can::SignalDef& signal = frame.message.definition->signals[i];
      line += before;
      before = ", ";
      line += signal.name;
      line += ' ';
      append_readable(line, frame.values[i].physical);
      if (!signal.unit.empty()) line += ' ' + signal.unit;
      if (const can::Text* label = label_of(frame, i)) line += " (" + *label + ')';
      if (with_raw_) {
        line += " [";
        line += frame.message.codec.signal(i).raw_text(frame.values[i].raw);
        line += ']';
      }
    });
    out += can::printable(line);
    out += '\n';
  }

 private:
  bool with_raw_;
};

// As RFC 4180 has it: quoted where it must be.
std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + '"';
}

class CsvFrames : public FrameWriter {
 public:
  CsvFrames(std::span<const ChosenMessage* const> messages, bool with_raw) : with_raw_(with_raw) {
    for (const ChosenMessage* message : messages) {
      for (std::size_t i = 0; i < message->wanted.size(); ++i) {
        if (message->wanted[i]) add_column(*message, i);
      }
    }
    constexpr std::size_t kColumnsMost = 2000;  // what a table can still be read with
    if (columns_ > kColumnsMost) {
      throw Failure{kUsage, "dbc decode: --csv would have " + std::to_string(columns_) +
                                " columns, expected at most " + std::to_string(kColumnsMost) +
                                ": choose with --messages or --signals"};
    }
  }
  std::string head() const override { return head_ + '\n'; }

  void append(const DecodedFrame& frame, std::string& out) override {
    append_seconds(out, frame.record.t_ns);
    out += ',';
    append_interface(frame.record.interface, out);
    std::size_t column = 0;
    std::size_t next = frame.message.first_column;
    for (std::size_t i = 0; i < frame.message.wanted.size(); ++i) {
      if (!frame.message.wanted[i]) continue;
      if (frame.values.has(i)) {
        out.append(next + 1 - column, ',');
        column = next + 1;
        append_cell(frame, i, out);
      }
      ++next;
    }
    out.append(columns_ - column, ',');
    out += '\n';
  }

 private:
  void add_column(const ChosenMessage& message, std::size_t i) {
    ++columns_;
    head_ += ',' + csv_cell(can::printable(message.definition->name + '.' +
                                           message.definition->signals[i].name));
  }
  void append_cell(const DecodedFrame& frame, std::size_t i, std::string& out) const {
    if (with_raw_) {
      out += frame.message.codec.signal(i).raw_text(frame.values[i].raw);
    } else {
      append_value(out, plain(frame.values[i].physical), frame.message.decimals[i]);
    }
  }

  void append_interface(std::string_view interface, std::string& out) {
    if (interface != interface_) {
      interface_ = interface;
      interface_cell_ = csv_cell(can::printable(interface_));
    }
    out += interface_cell_;
  }

  bool with_raw_;
  std::size_t columns_ = 0;
  std::string head_ = "t_s,iface";
  std::string interface_;
  std::string interface_cell_;
};

}  // namespace

const can::Text* label_of(const DecodedFrame& frame, std::size_t signal) {
  const can::ValueTable& table = frame.message.definition->signals[signal].values;
  if (!frame.values.has(signal) || table.empty()) return nullptr;
  const std::optional<std::int64_t> key = table_key(frame, signal);
  const auto found = key ? table.find(*key) : table.end();
  return found == table.end() ? nullptr : &found->second;
}

std::unique_ptr<FrameWriter> text_writer(bool with_raw) {
  return std::make_unique<TextFrames>(with_raw);
}
std::unique_ptr<FrameWriter> json_writer(bool with_raw) {
  return std::make_unique<JsonFrames>(with_raw);
}
std::unique_ptr<FrameWriter> csv_writer(std::span<const ChosenMessage* const> messages,
                                        bool with_raw) {
  return std::make_unique<CsvFrames>(messages, with_raw);
}

}  // namespace beltgrip::cli
