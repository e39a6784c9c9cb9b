#include "tools/cli/decoded_frame.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string_view>

#include "can_dbc/dbc/bring_near.h"
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

// Seconds with every digit that the log has, and no more zeros than needed. Behind them; there must
// be room for text::kNumberLongest characters.
char* write_seconds(char* out, std::int64_t t_ns) {
  constexpr std::uint64_t kSecond_ns = 1'000'000'000;
  if (t_ns < 0) *out++ = '-';
  const auto magnitude =
      t_ns < 0 ? ~static_cast<std::uint64_t>(t_ns) + 1 : static_cast<std::uint64_t>(t_ns);
  out = std::to_chars(out, out + text::kNumberLongest, magnitude / kSecond_ns).ptr;
  const auto fraction_ns = static_cast<std::uint32_t>(magnitude % kSecond_ns);
  if (fraction_ns % 1000 == 0) {
    if (fraction_ns != 0) return text::write_fraction(out, fraction_ns / 1000);
    *out++ = '.';
    *out++ = '0';
    return out;
  }
  const text::ThreeDigits& nanoseconds = text::kThreeDigits[fraction_ns % 1000];
  *out = '.';
  text::write_three(out + 1, text::kThreeDigits[fraction_ns / 1'000'000]);
  text::write_three(out + 4, text::kThreeDigits[fraction_ns / 1000 % 1000]);
  text::write_three(out + 7, nanoseconds);
  return out + 7 + nanoseconds.without_zeros;
}

void append_seconds(std::string& line, std::int64_t t_ns) {
  std::array<char, text::kNumberLongest> text;
  line.append(text.data(), write_seconds(text.data(), t_ns));
}

std::string json_text(std::string_view text) { return text::JsonWriter().value(text).take(); }

std::int64_t whole_key(const can::DecodedSignal& signal) {
  return static_cast<std::int64_t>(signal.raw);
}

// Where the signal's value table has its value; nothing: nowhere, whatever the table.
std::optional<std::int64_t> table_key(const DecodedFrame& frame, std::size_t signal) {
  const can::SignalCodec& codec = frame.message.codec.signal(signal);
  if (!codec.is_float()) return whole_key(frame.values[signal]);
  const double value = codec.value_of(frame.values[signal].raw);
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
    out += texts.head();
    for_each_present(frame, texts, out, [&](std::size_t i) {
      const double value = frame.values[i].physical;
      if (std::isfinite(value)) {
        append_value(out, value, texts.keys[i].decimals);
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

  void expect(const ChosenMessage& message) const override {
    if (message.number < texts_.size()) can::bring_near(&texts_[message.number], sizeof(Texts));
  }
  void expect_soon(const ChosenMessage& message) const override {
    if (message.number >= texts_.size()) return;
    const Texts& texts = texts_[message.number];
    can::bring_near(texts.all);
    can::bring_near(texts.keys);
    can::bring_near(texts.labels);
    can::bring_near(texts.of_labels);
    if (with_raw_) message.codec.bring_signals_near();
  }

 private:
  struct Key {
    std::uint32_t end = 0;       // in Texts::all; it begins where the key before ends
    std::uint32_t decimals = 0;  // of the signal's values, as text::decimals_of() has it
  };
  struct Label {
    std::int64_t key = 0;
    std::uint32_t begin = 0, end = 0;  // in Texts::all: "name":"text"
  };
  struct Labels {
    std::uint32_t signal = 0;
    bool is_float = false;
    std::uint32_t first = 0, end = 0;  // in Texts::of_labels, by their keys
  };
  // What never changes of a message: little of it, and together, as with many messages each frame
  // waits for the memory of its own.
  struct alignas(64) Texts {
    // ,"extended":false,"message":"X","signals":{ then of each signal ,"name": then the labels
    std::string all;
    std::uint32_t head_end = 0;
    std::vector<Key> keys;       // of each signal
    std::vector<Labels> labels;  // of the signals that have any
    std::vector<Label> of_labels;

    std::string_view head() const { return {all.data(), head_end}; }
    // With the comma before it.
    std::string_view key(std::size_t i) const {
      const std::uint32_t begin = i == 0 ? head_end : keys[i - 1].end;
      return {all.data() + begin, keys[i].end - begin};
    }
    std::string_view text(const Label& label) const {
      return {all.data() + label.begin, label.end - label.begin};
    }
  };

  const Texts& texts_of(const ChosenMessage& message) {
    if (message.number >= texts_.size()) texts_.resize(message.number + 1);
    Texts& texts = texts_[message.number];
    if (texts.head_end == 0) fill(texts, message);
    return texts;
  }

  void fill(Texts& texts, const ChosenMessage& message) {
    const can::MessageDef& definition = *message.definition;
    std::string& all = scratch_;
    const auto size = [&] { return static_cast<std::uint32_t>(all.size()); };
    all = R"(,"extended":)";
    all += definition.id.extended ? "true" : "false";
    all += R"(,"message":)";
    all += json_text(definition.name);
    all += R"(,"signals":{)";
    texts.head_end = size();
    texts.keys.reserve(definition.signals.size());
    for (const can::SignalDef& signal : definition.signals) {
      all += ',';
      all += json_text(signal.name);
      all += ':';
      texts.keys.push_back({size(), message.decimals[texts.keys.size()]});
    }
    for (std::uint32_t i = 0; i < definition.signals.size(); ++i) {
      const can::SignalDef& signal = definition.signals[i];
      if (signal.values.empty()) continue;
      const auto first = static_cast<std::uint32_t>(texts.of_labels.size());
      for (const auto& [value, text] : signal.values) {
        const std::uint32_t begin = size();
        all += json_text(signal.name);
        all += ':';
        all += json_text(text);
        texts.of_labels.push_back({value, begin, size()});
      }
      texts.labels.push_back({i, message.codec.signal(i).is_float(), first,
                              static_cast<std::uint32_t>(texts.of_labels.size())});
    }
    texts.all = all;  // no larger than it is
    texts.of_labels.shrink_to_fit();
  }

  static void append_labels(const DecodedFrame& frame, const Texts& texts, std::string& out) {
    bool first = true;
    for (const Labels& labels : texts.labels) {
      if (!frame.values.has(labels.signal)) continue;
      const std::optional<std::int64_t> key = labels.is_float
                                                  ? table_key(frame, labels.signal)
                                                  : whole_key(frame.values[labels.signal]);
      if (!key) continue;
      const Label* const end = texts.of_labels.data() + labels.end;
      const Label* const found = std::lower_bound(
          texts.of_labels.data() + labels.first, end, *key,
          [](const Label& label, std::int64_t wanted) { return label.key < wanted; });
      if (found == end || found->key != *key) continue;
      if (!first) out += ',';
      first = false;
      out += texts.text(*found);
    }
  }

  template <typename Write>
  static void for_each_present(const DecodedFrame& frame, const Texts& texts, std::string& out,
                               Write write) {
    bool first = true;
    frame.values.for_each_present([&](std::size_t i) {
      out += first ? texts.key(i).substr(1) : texts.key(i);
      first = false;
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
  std::string scratch_;  // what the text of the next message is put together in
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

// Mostly one: that is sooner done than a call.
char* write_commas(char* out, std::size_t count) {
  if (count != 1) return std::fill_n(out, count, ',');
  *out = ',';
  return out + 1;
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
    keep_interface(frame.record.interface);
    char* at = write_seconds(row_.data(), frame.record.t_ns);
    *at++ = ',';
    at = std::copy(interface_cell_.begin(), interface_cell_.end(), at);
    std::size_t column = 0;
    const auto go_to = [&](std::size_t next) {
      const std::size_t count = next - column;
      column = next;
      if (count < kCommasApart) {
        at = write_commas(at, count);
        return;
      }
      out.append(row_.data(), at);
      out.append(count, ',');
      at = row_.data();
    };
    frame.values.for_each_present([&](std::size_t i) {
      go_to(frame.message.columns[i] + std::size_t{1});
      at = write_cell(frame, i, at);
    });
    go_to(columns_);
    *at++ = '\n';
    out.append(row_.data(), at);
  }

  void expect_soon(const ChosenMessage& message) const override {
    can::bring_near(message.columns);
    can::bring_near(message.decimals);
    if (with_raw_) message.codec.bring_signals_near();
  }

 private:
  void add_column(const ChosenMessage& message, std::size_t i) {
    ++columns_;
    head_ += ',' + csv_cell(can::printable(message.definition->name + '.' +
                                           message.definition->signals[i].name));
  }
  char* write_cell(const DecodedFrame& frame, std::size_t i, char* at) const {
    if (!with_raw_) {
      return text::write_short(at, plain(frame.values[i].physical), frame.message.decimals[i]);
    }
    const std::string raw = frame.message.codec.signal(i).raw_text(frame.values[i].raw);
    return std::copy(raw.begin(), raw.end(), at);
  }

  void keep_interface(std::string_view interface) {
    if (interface != interface_) {
      interface_ = interface;
      interface_cell_ = csv_cell(can::printable(interface_));
    }
    // The longest row: a stamp, the interface, and in each column a number and its comma.
    row_.resize(2 * text::kNumberLongest + interface_cell_.size() +
                columns_ * (text::kNumberLongest + 1));
  }

  // Chosen: so many are written where they stay, not copied there. A fifth less or more: the same
  // time.
  static constexpr std::size_t kCommasApart = 64;

  bool with_raw_;
  std::size_t columns_ = 0;
  std::string head_ = "t_s,iface";
  std::string interface_;
  std::string interface_cell_;
  std::vector<char> row_;
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
