// `beltgrip dbc decode`: the frames of logs as text, CSV or JSON. Tools only.
#pragma once

#include <limits>
#include <string>
#include <vector>

namespace beltgrip::cli {

struct DecodeOptions {
  std::vector<std::string> dbc_paths;
  std::vector<std::string> log_paths{"-"};
  // At most one of them; none: text on standard output. "-": standard output.
  std::string text_path;
  std::string csv_path;
  std::string json_path;
  bool raw = false;
  std::vector<std::string> messages;  // names; none: all
  std::vector<std::string> signals;   // "Signal" or "Message.Signal"; none: all
  double from_s = -std::numeric_limits<double>::infinity();  // after the first frame of each log
  double to_s = std::numeric_limits<double>::infinity();
};

// Failure 64: a name that no DBC has, two outputs; 65, 66: a file that cannot be used, or of whose
// frames none is named.
void decode(const DecodeOptions& options);

}  // namespace beltgrip::cli
