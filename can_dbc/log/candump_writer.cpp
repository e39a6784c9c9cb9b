#include "can_dbc/log/candump_writer.h"

#include <algorithm>
#include <array>
#include <charconv>

#include "can_dbc/log/frame_bits.h"

namespace beltgrip::can {

namespace {

constexpr char kHexDigits[] = "0123456789ABCDEF";

void append_hex(std::string& text, std::uint32_t value, int digits) {
  for (int shift = 4 * (digits - 1); shift >= 0; shift -= 4) {
    text += kHexDigits[(value >> shift) & 0xFU];
  }
}

void append_frame(std::string& text, const CanFrame& frame) {
  constexpr int kStandardDigits = 3;
  constexpr int kExtendedDigits = 8;
  if (frame.error) {
    append_hex(text, frame.id.value | kErrorFlag, kExtendedDigits);
  } else {
    append_hex(text, frame.id.value, frame.id.extended ? kExtendedDigits : kStandardDigits);
  }
  text += '#';
  if (frame.remote) {
    text += 'R';
    if (frame.length > 0) text += kHexDigits[frame.length & 0xFU];
    return;
  }
  if (frame.fd) {
    text += '#';
    text += kHexDigits[(frame.bit_rate_switch ? 1U : 0U) | (frame.error_state_indicator ? 2U : 0U)];
  }
  for (std::size_t i = 0; i < std::min<std::size_t>(frame.length, kMaxPayload); ++i) {
    append_hex(text, frame.data[i], 2);
  }
}

}  // namespace

std::string frame_text(const CanFrame& frame) {
  std::string text;
  append_frame(text, frame);
  return text;
}

void CandumpWriter::write(std::int64_t t_ns, std::string_view interface, const CanFrame& frame) {
  line_.assign(1, '(');
  const bool negative = t_ns < 0;
  if (negative) line_ += '-';
  const auto magnitude =
      negative ? ~static_cast<std::uint64_t>(t_ns) + 1 : static_cast<std::uint64_t>(t_ns);
  std::array<char, 24> digits;
  const auto end =
      std::to_chars(digits.data(), digits.data() + digits.size(), magnitude / kSecond_ns).ptr;
  line_.append(digits.data(), end);
  line_ += '.';
  const auto fraction_ns = static_cast<std::uint32_t>(magnitude % kSecond_ns);
  const bool nine = fraction_ns % 1000 != 0;
  std::uint32_t fraction = nine ? fraction_ns : fraction_ns / 1000;
  const std::size_t places = nine ? 9 : 6;
  line_.append(places, '0');
  for (std::size_t i = 0; i < places; ++i, fraction /= 10) {
    line_[line_.size() - 1 - i] = static_cast<char>('0' + fraction % 10);
  }
  line_ += ") ";
  line_ += interface;
  line_ += ' ';
  append_frame(line_, frame);
  line_ += '\n';
  std::fwrite(line_.data(), 1, line_.size(), out_);
}

}  // namespace beltgrip::can
