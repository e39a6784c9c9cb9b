// A log's lines read by two parsers of one format: one takes its quick way to a frame wherever it
// has one, the other never does.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>

#include "can_dbc/log/format.h"

namespace beltgrip::test {

struct BothWays {
  std::size_t quick_frames = 0;
  bool alike = true;      // they say the same of every line
  std::string different;  // the first line of which they do not
};

inline BothWays read_both_ways(can::LineParser& quick, can::LineParser& plain,
                               std::string_view log) {
  constexpr std::size_t kLongest = 1024;  // of what a quick way wants to have before it
  const std::string text = std::string(log) + std::string(kLongest, '\n');
  BothWays read;
  can::LogRecord quick_record, plain_record;
  std::string_view left(text);
  while (left.size() >= kLongest) {
    const std::string_view line = left.substr(0, left.find('\n'));
    const char* const behind = quick.quick_frame(left, quick_record);
    const can::LineKind plain_kind = plain.parse(line, plain_record);
    can::LineKind quick_kind = can::LineKind::kFrame;
    if (behind == nullptr) quick_kind = quick.parse(line, quick_record);
    // The reader looks for carriage returns within a line before it hands it to parse().
    std::string_view without_end = line;
    while (without_end.ends_with('\r')) without_end.remove_suffix(1);
    bool alike = behind == nullptr || (behind == line.data() + line.size() + 1 &&
                                       without_end.find('\r') == std::string_view::npos);
    alike = alike && quick_kind == plain_kind;
    if (plain_kind == can::LineKind::kFrame) {
      alike = alike && quick_record.t_ns == plain_record.t_ns &&
              quick_record.interface == plain_record.interface &&
              quick_record.sent == plain_record.sent && quick_record.frame == plain_record.frame;
    }
    if (!alike) {
      read.alike = false;
      read.different = line;
      return read;
    }
    if (behind != nullptr) ++read.quick_frames;
    left.remove_prefix(line.size() + 1);
  }
  return read;
}

}  // namespace beltgrip::test
