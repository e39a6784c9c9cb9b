// The results of a replay that goes on where an earlier one ended: JSON lines in a file that grows
// log by log, so that what was done is there whenever the program ends. Tools only.
#pragma once

#include <cstdio>
#include <memory>
#include <set>
#include <string>

#include "tools/cli/output_file.h"

namespace beltgrip::cli {

class ResumedLines {
 public:
  // A file that is not there is begun. What follows the last summary belongs to a log that was not
  // finished and is dropped. Failure: 64 it is an input or standard output, 65 it holds other lines
  // than those of a replay (and stays as it is), 73 it cannot be opened.
  ResumedLines(const std::string& path, const Inputs& inputs);

  bool has(const std::string& log) const { return done_.contains(log); }
  std::size_t count() const { return done_.size(); }
  // All lines of one log, the summary last. False: they could not be written.
  bool append(const std::string& lines);

 private:
  std::set<std::string> done_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_{nullptr, &std::fclose};
};

}  // namespace beltgrip::cli
