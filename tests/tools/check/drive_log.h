// A candump log as lines of text, and what may go wrong with it: the arithmetic of frames and
// checksums here is the test's own.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace beltgrip::test {

struct LogFrame {
  double t_s = 0.0;  // from the first frame of the log
  std::uint32_t id = 0;
  std::vector<std::uint8_t> data;
};

// Every frame through `change`, which leaves it, changes it, or says false: it is left out.
std::string changed_log(std::string_view log, const std::function<bool(LogFrame&)>& change);

// CRC-8, polynomial 0x1D, start 0, over the data id (low byte first) and all bytes but `at`.
std::uint8_t crc_of(const LogFrame& frame, std::uint16_t data_id, std::size_t at);

// `text` with the first `from` replaced; throws where there is none.
std::string replaced(std::string text, std::string_view from, std::string_view to);

}  // namespace beltgrip::test
