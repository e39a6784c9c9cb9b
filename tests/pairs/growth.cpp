// What grows with the size of the work, and what must not: decoding with more messages in the DBC,
// replay of longer logs and of more of them.
#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <stdexcept>

#include "tests/pairs/bench_pairs.h"

namespace beltgrip::test {

namespace {

constexpr int kRounds = 3;  // of which the middle one counts
constexpr std::int64_t kMegabyte = 1'000'000;

double median_s(const Work& work) {
  std::array<double, kRounds> taken_s{};
  for (double& each_s : taken_s) each_s = work();
  std::sort(taken_s.begin(), taken_s.end());
  return taken_s[kRounds / 2];
}

void by_messages(const Folder& folder, const std::string& beltgrip) {
  constexpr int kFrames = 2'000'000;
  std::printf("%10s %14s %16s %12s\n", "messages", "DBC", "load and end", "a frame");
  const std::string dbc = folder.path("grown.dbc");
  const std::string log = folder.path("grown.log");
  const std::string one = folder.path("one.log");
  for (const int messages : {1, 10, 100, 1'000, 10'000}) {
    const std::string text = made_dbc(messages);
    write_text(dbc, text);
    const auto ids = static_cast<unsigned>(messages);
    write_log(log, kFrames, 0, ids);
    write_log(one, 1, 0, ids);
    const auto decode = [&](const std::string& path) {
      return median_s(
          program({beltgrip, "dbc", "decode", "--dbc", dbc, path, "--json", "/dev/null"}));
    };
    const double load_s = decode(one);
    std::printf("%10d %11.3f MB %13.1f ms %9.0f ns\n", messages,
                static_cast<double>(text.size()) / kMegabyte, load_s * 1e3,
                (decode(log) - load_s) / kFrames * 1e9);
    std::fflush(stdout);
  }
}

// What replay says of itself.
struct Replayed {
  double frames = 0.0;
  double processor_s = 0.0;
  double peak_MB = 0.0;
};

Replayed replay(const std::string& beltgrip, const std::string& configuration,
                const std::string& logs) {
  const std::string command =
      beltgrip + " replay " + logs + " --config " + configuration + " 2>&1 >/dev/null";
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> said(popen(command.c_str(), "r"), &pclose);
  Replayed result;
  std::array<char, 512> line;
  while (said != nullptr && std::fgets(line.data(), line.size(), said.get()) != nullptr) {
    std::sscanf(line.data(),
                "beltgrip: %lf frames in %*f s, %*f million frames/s; processor %lf s, peak memory "
                "%lf MB",
                &result.frames, &result.processor_s, &result.peak_MB);
  }
  if (result.peak_MB == 0.0) throw std::runtime_error(command + ": does not say how it went");
  return result;
}

void by_length(const Folder& folder, const std::string& beltgrip, const std::string& trace,
               const std::string& configuration, bool large) {
  std::vector<std::int64_t> sizes{10 * kMegabyte, 100 * kMegabyte};
  if (large) sizes.insert(sizes.end(), {1'000 * kMegabyte, 5'000 * kMegabyte});
  std::printf("%10s %12s %12s %12s %12s\n", "log", "frames", "processor", "a frame", "at most");
  const std::string log = folder.path("long.log");
  for (const std::int64_t size : sizes) {
    write_repeated(trace, log, 4, size);
    const Replayed it = replay(beltgrip, configuration, log);
    std::printf("%7lld MB %12.0f %10.2f s %9.0f ns %9.1f MB\n",
                static_cast<long long>(size / kMegabyte), it.frames, it.processor_s,
                it.processor_s / it.frames * 1e9, it.peak_MB);
    std::fflush(stdout);
  }
  std::filesystem::remove(log);
}

void by_count(const Folder& folder, const std::string& beltgrip, const std::string& trace,
              const std::string& configuration) {
  std::printf("%10s %12s %12s %12s %12s\n", "logs", "frames", "processor", "a frame", "at most");
  const std::string log = folder.path("each.log");
  write_repeated(trace, log, 4, 10 * kMegabyte);
  for (const int count : {1, 8, 64}) {
    std::string logs;
    for (int i = 0; i < count; ++i) logs += log + ' ';
    const Replayed it = replay(beltgrip, configuration, logs);
    std::printf("%10d %12.0f %10.2f s %9.0f ns %9.1f MB\n", count, it.frames, it.processor_s,
                it.processor_s / it.frames * 1e9, it.peak_MB);
    std::fflush(stdout);
  }
}

}  // namespace

void show_growth(const Folder& folder, const std::string& beltgrip, bool large) {
  by_messages(folder, beltgrip);
  const std::string drive = folder.path("drive");
  program({beltgrip, "simulate", "--set", "run.cycles=8", "--out-dir", drive, "--force"})();
  const std::string trace = drive + "/trace.log";
  const std::string configuration = drive + "/beltgrip.toml";
  by_length(folder, beltgrip, trace, configuration, large);
  by_count(folder, beltgrip, trace, configuration);
}

}  // namespace beltgrip::test
