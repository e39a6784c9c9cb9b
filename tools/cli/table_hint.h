// A table of signals that somebody gives for a CAN log: said so, instead of "no frame". Tools only.
#pragma once

#include <string>

namespace beltgrip::cli {

// "; it looks like a table of ..."; empty where the beginning of the file does not look like one.
std::string table_hint(const std::string& path);

}  // namespace beltgrip::cli
