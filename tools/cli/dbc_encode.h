// `beltgrip dbc encode`: a frame from the physical values of its signals. Tools only.
#pragma once

#include <string>
#include <vector>

namespace beltgrip::cli {

struct EncodeOptions {
  std::vector<std::string> dbc_paths;
  std::string message;
  std::vector<std::string> values;  // "SIGNAL=VALUE": a number, or a text of its value table
};

// One line on standard output, in candump's notation, as cansend takes it. A signal that is not
// given has its start value (attribute GenSigStartValue, raw), else the raw value 0.
// Failure 64: a name that the files do not have, a value that the signal cannot carry; 65, 66: a
// file that cannot be used.
void encode(const EncodeOptions& options);

}  // namespace beltgrip::cli
