// From the instant of a sample to its frame on the bus: beltgripd against the least that a program
// can do with the same timer and one write, both in the same run on one vcan, stamped by the
// kernel. Prints the delays and their ratio; what they are is the machine's business.
// tests/latency.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>

#include "can_dbc/log/can_log.h"
#include "tests/support/assertions.h"
#include "tests/system/vcan/rig.h"

namespace beltgrip::test {
namespace {

constexpr std::int64_t kPeriod_ns = 5'000'000;
constexpr canid_t kSlip = 0x6A1, kMinimal = 0x555;

// "(1700000000.123456789) start"
std::int64_t start_of(const std::string& record) {
  const auto log = can::LogReader::open(record, true);
  can::LogRecord line;
  while (log->next(line)) {
    const std::string note(line.note);
    const std::size_t point = note.find('.');
    if (!note.ends_with(" start") || point == std::string::npos) continue;
    return std::stoll(note.substr(1, point - 1)) * 1'000'000'000 +
           std::stoll(note.substr(point + 1, 9));
  }
  return 0;
}

struct Delays {
  std::vector<double> us;  // sorted
  double at(double share) const {
    return us[std::min(us.size() - 1,
                       static_cast<std::size_t>(share * static_cast<double>(us.size())))];
  }
};

// What is later than a period counts as what it is late by in its own period.
Delays delays(const std::vector<std::int64_t>& stamps_ns, std::int64_t start_ns) {
  Delays found;
  for (const std::int64_t stamp_ns : stamps_ns) {
    found.us.push_back(static_cast<double>((stamp_ns - start_ns) % kPeriod_ns) * 1e-3);
  }
  std::sort(found.us.begin(), found.us.end());
  return found;
}

// What the kernel has counted of a process.
struct Spent {
  double processor_s = 0.0;
  std::string peak;  // "6912 kB"
};

Spent spent_by(pid_t pid) {
  const std::string place = "/proc/" + std::to_string(pid);
  Spent spent;
  std::string line;
  std::ifstream stat(place + "/stat");
  std::getline(stat, line);
  unsigned long user = 0, system = 0;
  // Behind the name in brackets: state, ten more, then the two.
  std::sscanf(line.c_str() + line.rfind(')'),
              ") %*c %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %lu %lu", &user, &system);
  spent.processor_s =
      static_cast<double>(user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
  std::ifstream status(place + "/status");
  while (std::getline(status, line)) {
    constexpr std::string_view kPeak = "VmHWM:";
    if (line.starts_with(kPeak)) spent.peak = line.substr(line.find_first_of("0123456789"));
  }
  return spent;
}

// System calls of the process while frames of the rig come, per frame.
double calls_a_frame(pid_t pid, const std::string& folder, const BusSocket& bus) {
  constexpr int kFrames = 600;
  const std::string counted = folder + "/calls";
  Process strace({"strace", "-c", "-f", "-o", counted, "-p", std::to_string(pid)});
  if (!strace.wait_for_error("attached", kLimit)) return 0.0;
  int frames = 0;
  bus.receive_until(
      [&](const ReceivedFrame& frame) {
        const canid_t id = frame.frame.can_id;
        if (id == 0x110 || id == 0x120 || id == 0x130) ++frames;
        return frames >= kFrames;
      },
      kLimit);
  strace.signal(SIGINT);
  strace.wait(kLimit);
  std::ifstream table(counted);
  std::string line;
  double calls = 0.0;
  while (std::getline(table, line)) {
    // 100.00    0.004321           3      1234        12 total
    if (line.ends_with(" total")) std::sscanf(line.c_str(), "%*f %*f %*d %lf", &calls);
  }
  return calls / frames;
}

class Latency : public Vcan, public testing::WithParamInterface<bool> {};

TEST_P(Latency, FromSampleToFrame) {
  const char* given = std::getenv("LATENCY_FRAMES");
  const std::size_t wanted = given == nullptr ? 1000 : std::stoul(given);
  std::vector<std::string> before;
  if (GetParam()) before = {"chrt", "-f", "60"};
  const auto with = [&](std::vector<std::string> argv) {
    argv.insert(argv.begin(), before.begin(), before.end());
    return argv;
  };
  const BusSocket bus("vcan0");
  const bool full = std::getenv("LATENCY_FULL") != nullptr;
  const std::string log = full ? write_full_log(folder()) : write_steady_log(folder());
  const Process player(canplayer(log, "vcan0", true));
  Process daemon(with({program("beltgripd"), "--config", write_rig_config(folder(), "vcan0"),
                       "--record", folder() + "/record"}));
  ASSERT_TRUE(daemon.wait_for_error("-> Ramping", kLimit)) << daemon.err();
  Process minimal(with({BELTGRIP_BIN_DIR "/../tests/minimal_sender", "vcan0",
                        std::to_string(kMinimal), std::to_string(kPeriod_ns)}));
  ASSERT_TRUE(minimal.wait_for_output("start ", kLimit));
  std::vector<std::int64_t> ours_ns, theirs_ns;
  const Spent before_it = spent_by(daemon.pid());
  const auto begin = std::chrono::steady_clock::now();
  const auto seen = bus.receive_until(
      [&](const ReceivedFrame& frame) {
        if (frame.frame.can_id == kSlip && !theirs_ns.empty()) ours_ns.push_back(frame.t_ns);
        if (frame.frame.can_id == kMinimal) theirs_ns.push_back(frame.t_ns);
        return ours_ns.size() >= wanted;
      },
      Milliseconds(static_cast<int>(wanted) * 40));
  ASSERT_TRUE(seen.has_value()) << daemon.err();
  const double took_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const Spent spent = spent_by(daemon.pid());
  const double calls = full ? calls_a_frame(daemon.pid(), folder(), bus) : 0.0;
  minimal.signal(SIGTERM);
  minimal.wait(kLimit);
  daemon.signal(SIGTERM);
  ASSERT_EQ(daemon.wait(kLimit), 0) << daemon.err();
  std::string record;
  for (const auto& each : std::filesystem::directory_iterator(folder() + "/record")) {
    if (record.empty() || each.path().string() < record) record = each.path();
  }
  const Delays ours = delays(ours_ns, start_of(record));
  const Delays theirs = delays(theirs_ns, std::stoll(minimal.out().substr(6)));
  std::printf("%-22s %8s %8s %8s %8s %8s\n", GetParam() ? "FIFO 60, us" : "ordinary, us", "p50",
              "p90", "p99", "p99.9", "frames");
  for (const auto& [name, each] : {std::pair{"beltgripd", &ours}, {"timer and write", &theirs}}) {
    std::printf("%-22s %8.0f %8.0f %8.0f %8.0f %8zu\n", name, each->at(0.5), each->at(0.9),
                each->at(0.99), each->at(0.999), each->us.size());
  }
  std::printf("%-22s %8.2f %8.2f %8.2f %8.2f\n", "ratio", ours.at(0.5) / theirs.at(0.5),
              ours.at(0.9) / theirs.at(0.9), ours.at(0.99) / theirs.at(0.99),
              ours.at(0.999) / theirs.at(0.999));
  std::printf("beltgripd took %.1f %% of one processor and %s at its peak",
              100.0 * (spent.processor_s - before_it.processor_s) / took_s, spent.peak.c_str());
  if (calls > 0.0) std::printf("; %.2f system calls a frame of the rig", calls);
  if (full && calls == 0.0) std::printf("; its system calls are not counted: no strace here");
  std::printf("\n");
  const std::size_t own = daemon.err().find("latency: ");
  std::printf("of itself beltgripd says: %s\n",
              daemon.err().substr(own, daemon.err().find('\n', own) - own).c_str());
}

INSTANTIATE_TEST_SUITE_P(, Latency, testing::Bool(),
                         [](const auto& test) { return test.param ? "Fifo" : "Ordinary"; });

}  // namespace
}  // namespace beltgrip::test
