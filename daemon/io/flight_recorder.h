// The flight recorder: the frames around every experiment and every fault, as candump logs packed
// with zstd in one folder of limited size, where the oldest go first. A thread of its own takes
// what the real-time thread left in the rings, so a disk may take its time; what does not fit into
// the rings is lost and counted. A disk that is full or cannot be written is one line in the log,
// and another attempt a minute later.
//
// Beside the frames stand lines that begin with '#', which players of candump logs pass over:
// whatever else the pipeline was told (record_tap.h). With them `beltgrip replay` decides what the
// daemon decided; a record that begins with the daemon gives the same frames, byte by byte.
//
//   # beltgrip-record 3 INTERFACE [INTERFACE]    of bus 0, of bus 1
//   # (T) start              the first sample
//   (T) can0 110#...         received; "T" at its end: sent by this daemon, and confirmed
//   # (T) after              the frames that follow had come too late for the sample before T
//   # (T) late NOW           the sample at T was taken at NOW
//   # (T) bus BUS STATE      0 active, 1 warning, 2 passive, 3 off, 4 down, 5 absent
//   # (T) lost N             so many frames, before the next one
//   # (T) failed BUS ID HOW  what the sample at T could not send: 1 full, 2 down, 3 failed
//   # (T) memory N...        numbers of estimator/belt/belt_memory.h, before what was learned
//   # (T) learned D U A B C D    doubtful, unwritten, the history's groups: - or mu_max, its lower
//                                end and the scatter in percent, with slashes between
//   # (T) end NOW            the daemon stopped
//
// Version 1 had mu_max alone in a group, version 2 no memory.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "daemon/core/loop/record_tap.h"

namespace beltgrip::daemon {

struct RecordLimits {
  std::uint64_t file_bytes = std::uint64_t{16} << 20;
  std::uint64_t folder_bytes = std::uint64_t{256} << 20;
  Duration before = 10 * kSecond;  // an experiment or a fault
  Duration after = 10 * kSecond;
};

class FlightRecorder {
 public:
  // Wall clock at a time of the loop's clock, for names and stamps.
  FlightRecorder(std::string folder, std::vector<std::string> interfaces, RecordRings& rings,
                 std::int64_t wall_offset_ns, const RecordLimits& limits = {});
  ~FlightRecorder();
  FlightRecorder(const FlightRecorder&) = delete;
  FlightRecorder& operator=(const FlightRecorder&) = delete;

  void stop();  // after the loop: writes what is left

  struct Message {
    bool warning;
    std::string line;
  };
  // For the log; any thread.
  std::vector<Message> take_messages();

 private:
  class File;
  void run();
  void drain();
  void take(const RecordItem& item);
  void judge(const RecordItem& mark);
  void remember(const RecordItem& item);
  void open(MonoTime t);
  void open_file(MonoTime t);
  void make_room();
  void write(const RecordItem& item);
  void write_line(MonoTime t, const std::string& text);
  void write_learned(MonoTime t);
  void close();
  void trouble(MonoTime t, const std::string& what);
  void say(bool warning, const std::string& line);

  const std::string folder_;
  const std::vector<std::string> interfaces_;  // by bus
  RecordRings& rings_;
  const std::int64_t wall_offset_ns_;
  const RecordLimits limits_;
  std::deque<RecordItem> before_;  // the last seconds, while nothing is recorded
  estimator::LearnedFriction learned_;
  bool has_learned_ = false;
  std::unique_ptr<File> file_;
  MonoTime keep_until_;
  bool in_experiment_ = false;
  std::uint32_t faults_ = 0;
  std::uint64_t dropped_ = 0;
  bool complained_ = false;
  MonoTime retry_at_;
  std::mutex mutex_;
  std::vector<Message> messages_;
  std::atomic<bool> ending_{false};
  std::thread thread_;
};

}  // namespace beltgrip::daemon
