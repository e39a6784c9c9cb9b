#include "tools/cli/resumed_lines.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "daemon/io/json_text.h"
#include "tools/cli/failure.h"

namespace beltgrip::cli {

namespace {

constexpr std::string_view kBegin = "{";

// The name of the log if the line is a summary; empty for an experiment, and where a signal ended
// the run before the log's end. False: neither.
bool read_line(const std::string& line, std::string& log) {
  const auto values = daemon::json_if_any(line);
  if (!values.is_object() || !values.contains("type") || !values.contains("log")) return false;
  if (!values["log"].is_string()) return false;
  const bool whole = !values.value("stopped", false);
  if (values["type"] == "summary" && whole) log = values["log"].get<std::string>();
  return values["type"] == "summary" || values["type"] == "experiment";
}

}  // namespace

ResumedLines::ResumedLines(const std::string& path, const Inputs& inputs) {
  if (path == "-")
    throw Failure{kUsage, "replay: --resume goes on in a file, expected --json FILE"};
  inputs.demand_apart(path);
  std::streamoff whole = 0;
  if (std::ifstream in(path, std::ios::binary); in) {
    std::string line;
    for (std::size_t number = 1; std::getline(in, line); ++number) {
      const bool cut_off = in.eof();  // it was being written
      std::string log;
      if (cut_off ? !line.starts_with(kBegin) : !read_line(line, log)) {
        throw Failure{kBadInput, path + ":" + std::to_string(number) +
                                     ": found no result of a replay, expected a file that "
                                     "beltgrip replay --json wrote"};
      }
      if (log.empty()) continue;
      done_.insert(log);
      whole = in.tellg();
    }
  }
  file_.reset(std::fopen(path.c_str(), "ab"));
  if (file_ == nullptr || ftruncate(fileno(file_.get()), whole) != 0) {
    throw Failure{kCannotCreate, path + ": cannot be written (" + std::strerror(errno) + ")"};
  }
}

bool ResumedLines::append(const std::string& lines) {
  return std::fwrite(lines.data(), 1, lines.size(), file_.get()) == lines.size() &&
         std::fflush(file_.get()) == 0;
}

}  // namespace beltgrip::cli
