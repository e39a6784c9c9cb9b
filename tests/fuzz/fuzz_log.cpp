// Any bytes as a log: no crash, no hang; every frame read is one that exists on a bus; as lines of
// each format with a quick way to a frame they say the same by the plain way; what was read,
// written by the candump writer and read again is the same.
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include "can_dbc/log/can_log.h"
#include "can_dbc/log/candump_writer.h"
#include "can_dbc/log/format.h"
#include "tests/can_dbc/log/both_ways.h"

namespace {

using namespace beltgrip::can;

void require(bool condition, int line = __builtin_LINE()) {
  if (condition) return;
  std::fprintf(stderr, "fuzz_log.cpp:%d\n", line);
  std::abort();
}

// A file in memory, with a path.
class MemoryFile {
 public:
  MemoryFile(const void* data, std::size_t size) : descriptor_(memfd_create("fuzz_log", 0)) {
    require(descriptor_ >= 0);
    require(write(descriptor_, data, size) == static_cast<ssize_t>(size));
  }
  ~MemoryFile() { close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
};

struct Frame {
  std::int64_t t_ns;
  std::string interface;
  CanFrame frame;
  friend bool operator==(const Frame&, const Frame&) = default;
};

void check(const CanFrame& frame) {
  require(frame.id.value <= (frame.id.extended || frame.error ? kExtendedIdMax : kStandardIdMax));
  require(frame.length <= (frame.fd ? kMaxPayload : 8));
  require(static_cast<int>(frame.remote) + frame.error + frame.fd <= 1);
  require(frame.fd || (!frame.bit_rate_switch && !frame.error_state_indicator));
  require(!frame.error || !frame.id.extended);
  const std::size_t used = frame.payload().size();
  for (std::size_t i = used; i < kMaxPayload; ++i) require(frame.data[i] == 0);
}

std::vector<Frame> read(const MemoryFile& file, LogStats& stats) {
  const auto reader = LogReader::open(file.path());
  std::vector<Frame> frames;
  LogRecord record;
  while (reader->next(record)) {
    check(record.frame);
    frames.push_back({record.t_ns, std::string(record.interface), record.frame});
  }
  stats = reader->stats();
  require(!reader->next(record));
  return frames;
}

void check_quick_ways(std::string_view log) {
  constexpr std::size_t kLongest = 30000;  // far from what is too long for a line
  if (log.size() > kLongest) return;
  Sample sample;
  for (std::string_view left = log; !left.empty();) {
    sample.push_back(left.substr(0, left.find('\n')));
    left.remove_prefix(std::min(left.size(), sample.back().size() + 1));
  }
  const auto alike = [&](auto make) {
    require(beltgrip::test::read_both_ways(*make(), *make(), log).alike);
  };
  alike([&] { return make_candump_parser(sample); });
  alike(make_asc_parser);
  alike(make_trc_parser);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const MemoryFile input(data, size);
  LogStats stats;
  const std::vector<Frame> frames = read(input, stats);
  require(stats.frames == frames.size() && stats.frames + stats.lines_bad <= stats.lines);
  require(stats.first_bad.size() == std::min<std::uint64_t>(stats.lines_bad, 10));
  for (const BadLine& bad : stats.first_bad) {
    require(!bad.reason.empty());
    require(stats.binary ? bad.line == 0 : bad.line >= 1 && bad.line <= stats.lines);
    // Packed input has more bytes than these.
    const bool packed = size >= 2 && ((data[0] == 0x1F && data[1] == 0x8B) || data[0] == 0x28);
    require(packed || bad.byte <= size);
  }

  check_quick_ways({reinterpret_cast<const char*>(data), size});

  char* text = nullptr;
  std::size_t length = 0;
  std::FILE* out = open_memstream(&text, &length);
  CandumpWriter writer(out);
  bool writable = !frames.empty();
  for (const Frame& frame : frames) {
    writable = writable && !frame.interface.empty() && frame.interface.size() < 16 &&
               frame.interface.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789") ==
                   std::string::npos;
    writer.write(frame.t_ns, frame.interface, frame.frame);
  }
  std::fclose(out);
  if (writable) {
    LogStats again;
    require(read(MemoryFile(text, length), again) == frames);
    require(again.lines_bad == 0);
  }
  std::free(text);
  return 0;
}
