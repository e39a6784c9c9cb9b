#include "tests/tools/check/drive_log.h"

#include <charconv>
#include <cmath>
#include <stdexcept>

namespace beltgrip::test {

std::string changed_log(std::string_view log, const std::function<bool(LogFrame&)>& change) {
  constexpr char kHex[] = "0123456789ABCDEF";
  std::string out;
  double first_s = -1.0;
  for (std::size_t at = 0; at < log.size();) {
    const std::size_t end = std::min(log.find('\n', at), log.size());
    const std::string_view line = log.substr(at, end - at);
    at = end + 1;
    // (1700000000.000000) vcan0 123#0011
    const std::size_t close = line.find(')'), hash = line.find('#'), blank = line.rfind(' ');
    if (line.empty() || line[0] != '(' || hash == std::string_view::npos) {
      throw std::runtime_error("not a line of candump: " + std::string(line));
    }
    LogFrame frame;
    std::from_chars(line.data() + 1, line.data() + close, frame.t_s);
    if (first_s < 0.0) first_s = frame.t_s;
    frame.t_s -= first_s;
    std::from_chars(line.data() + blank + 1, line.data() + hash, frame.id, 16);
    for (std::size_t i = hash + 1; i + 1 < line.size(); i += 2) {
      std::uint8_t byte = 0;
      std::from_chars(line.data() + i, line.data() + i + 2, byte, 16);
      frame.data.push_back(byte);
    }
    if (!change(frame)) continue;
    out += line.substr(0, blank + 1);
    for (int digit = 2; digit >= 0; --digit) out += kHex[frame.id >> (4 * digit) & 15];
    out += '#';
    for (const std::uint8_t byte : frame.data) {
      out += kHex[byte >> 4];
      out += kHex[byte & 15];
    }
    out += '\n';
  }
  return out;
}

std::uint8_t crc_of(const LogFrame& frame, std::uint16_t data_id, std::size_t at) {
  std::vector<std::uint8_t> bytes{static_cast<std::uint8_t>(data_id & 0xFF),
                                  static_cast<std::uint8_t>(data_id >> 8)};
  for (std::size_t i = 0; i < frame.data.size(); ++i) {
    if (i != at) bytes.push_back(frame.data[i]);
  }
  unsigned crc = 0;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 0x80) != 0 ? (crc << 1 ^ 0x1D) & 0xFF : crc << 1;
  }
  return static_cast<std::uint8_t>(crc);
}

std::string replaced(std::string text, std::string_view from, std::string_view to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::runtime_error("no such text: " + std::string(from));
  return text.replace(at, from.size(), to);
}

}  // namespace beltgrip::test
