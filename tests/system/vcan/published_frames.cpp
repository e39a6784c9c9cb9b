#include "tests/system/vcan/published_frames.h"

#include <fstream>
#include <regex>
#include <stdexcept>

namespace beltgrip::test {
namespace {

// AUTOSAR E2E profile 1, variant 1A, as interfaces for other nodes describe it.
std::uint8_t profile_1_crc(std::uint16_t data_id, const std::uint8_t* payload) {
  std::array<std::uint8_t, 9> bytes{static_cast<std::uint8_t>(data_id & 0xFF),
                                    static_cast<std::uint8_t>(data_id >> 8)};
  for (std::size_t i = 1; i < 8; ++i) bytes[i + 1] = payload[i];
  unsigned crc = 0;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 0x80U) != 0 ? (crc << 1) ^ 0x11DU : crc << 1;
  }
  return static_cast<std::uint8_t>(crc);
}

}  // namespace

PublishedFrames::PublishedFrames(Control control) : control_(control) {
  std::ifstream file(BELTGRIP_SOURCE_DIR "/can_dbc/beltgrip.dbc");
  const std::regex message_line(R"(BO_ (\d+) (\w+): 8 .*)");
  const std::regex signal_line(R"( SG_ (\w+) : (\d+)\|(\d+)@1([+-]) \(([^,]+),([^)]+)\) .*)");
  Message* message = nullptr;
  std::smatch part;
  for (std::string line; std::getline(file, line);) {
    if (std::regex_match(line, part, message_line)) {
      message = &messages_[static_cast<canid_t>(std::stoul(part[1]))];
      message->name = part[2];
      frames_[message->name];
    } else if (std::regex_match(line, part, signal_line)) {
      message->signals.push_back({part[1], static_cast<unsigned>(std::stoul(part[2])),
                                  static_cast<unsigned>(std::stoul(part[3])), part[4] == "-",
                                  std::stod(part[5]), std::stod(part[6])});
    }
  }
  if (messages_.size() != 4) throw std::runtime_error("beltgrip.dbc: four messages expected");
}

Published PublishedFrames::last(const std::string& message) const {
  const std::vector<Published>& all = of(message);
  return all.empty() ? Published{} : all.back();
}

bool PublishedFrames::take(const ReceivedFrame& seen) {
  const auto found = messages_.find(seen.frame.can_id);
  if (found == messages_.end()) return false;
  const auto& [id, message] = *found;
  const std::string what = message.name + " no. " + std::to_string(of(message.name).size()) + ": ";
  if (control_ == Control::kObserve && message.name == "BeltGripClamp") {
    problems_.push_back(what + "sent in observe");
  }
  if (seen.fd || seen.frame.len != 8) {
    problems_.push_back(what + "not a classic frame of 8 bytes");
    return true;
  }
  if (seen.frame.data[0] != profile_1_crc(static_cast<std::uint16_t>(id), seen.frame.data)) {
    problems_.push_back(what + "CRC");
  }
  const unsigned counter = seen.frame.data[1] & 0xFU;
  const auto previous = counters_.find(id);
  if (counter > 14 || (previous != counters_.end() && counter != (previous->second + 1) % 15)) {
    problems_.push_back(what + "counter " + std::to_string(counter));
  }
  counters_[id] = counter;

  std::uint64_t payload = 0;
  for (unsigned i = 0; i < 8; ++i) payload |= std::uint64_t{seen.frame.data[i]} << (8 * i);
  Published published{seen.t_ns, {}};
  for (const Signal& signal : message.signals) {
    const std::uint64_t raw = payload << (64 - signal.start - signal.length);
    const double value =
        signal.is_signed
            ? static_cast<double>(static_cast<std::int64_t>(raw) >> (64 - signal.length))
            : static_cast<double>(raw >> (64 - signal.length));
    published.signals[signal.name] = value * signal.scale + signal.offset;
  }
  frames_[message.name].push_back(std::move(published));
  return true;
}

}  // namespace beltgrip::test
