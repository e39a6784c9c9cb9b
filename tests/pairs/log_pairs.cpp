#include <stdexcept>

#include "can_dbc/log/can_log.h"
#include "tests/pairs/bench_pairs.h"
#include "tests/pairs/plain_reader.h"

namespace beltgrip::test {

namespace {

constexpr int kFrames = 1'000'000;

void demand(long frames) {
  if (frames != kFrames) throw std::runtime_error("the log: read differently");
}

long read(const std::string& path) {
  const auto reader = can::LogReader::open(path);
  can::LogRecord record;
  long frames = 0;
  while (reader->next(record)) ++frames;
  return frames;
}

}  // namespace

std::vector<Pair> log_pairs(const Folder& folder) {
  const std::string path = folder.path("read.log");
  write_log(path, kFrames, 0x100, 64);
  const Work ours = timed([path] { demand(read(path)); });
  return {{"read a candump log", "fgets and sscanf", kFrames, "frame", ours,
           timed([path] { demand(plain_read(path.c_str())); })},
          {"read a candump log", "counting its lines", kFrames, "frame", ours,
           timed([path] { demand(plain_count_lines(path.c_str())); })}};
}

}  // namespace beltgrip::test
