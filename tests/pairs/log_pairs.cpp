#include <sys/socket.h>
#include <unistd.h>

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

// canplayer opens one even where it writes to its standard output.
bool has_can_sockets() {
  const int socket = ::socket(PF_CAN, SOCK_RAW, 1);
  if (socket >= 0) ::close(socket);
  return socket >= 0;
}

}  // namespace

std::vector<Pair> log_pairs(const Folder& folder) {
  const std::string path = folder.path("read.log");
  write_log(path, kFrames, 0x100, 64);
  const Work ours = timed([path] { demand(read(path)); });
  std::vector<Pair> pairs{{"read a candump log", "fgets and sscanf", kFrames, "frame", ours,
                           timed([path] { demand(plain_read(path.c_str())); })},
                          {"read a candump log", "counting its lines", kFrames, "frame", ours,
                           timed([path] { demand(plain_count_lines(path.c_str())); })}};
  for (const char* kind : {"asc", "trc", "csv"}) {
    const std::string other = folder.path(std::string("read.") + kind);
    write_as(path, other);
    pairs.push_back({std::string("read a .") + kind + " log", "counting its lines", kFrames,
                     "frame", timed([other] { demand(read(other)); }),
                     timed([other] { plain_count_lines(other.c_str()); })});
  }
  if (has_can_sockets()) {
    pairs.push_back({"read a candump log", "canplayer, to stdout", kFrames, "frame", ours,
                     program({"canplayer", "-t", "-I", path, "stdout=can0"})});
  }
  return pairs;
}

}  // namespace beltgrip::test
