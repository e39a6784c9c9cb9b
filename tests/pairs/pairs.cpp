#include "tests/pairs/pairs.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <stdexcept>

namespace beltgrip::test {

namespace {

double processor_time_s() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

double at_share(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(
      std::lround(share * static_cast<double>(values.size() - 1)))];
}

}  // namespace

Work timed(std::function<void()> work) {
  return [work = std::move(work)] {
    const double begin_s = processor_time_s();
    work();
    return processor_time_s() - begin_s;
  };
}

Work program(std::vector<std::string> argv) {
  return [argv = std::move(argv)] {
    std::vector<char*> words;
    for (const std::string& word : argv) words.push_back(const_cast<char*>(word.c_str()));
    words.push_back(nullptr);
    posix_spawn_file_actions_t silence;
    posix_spawn_file_actions_init(&silence);
    for (const int descriptor : {STDOUT_FILENO, STDERR_FILENO}) {
      posix_spawn_file_actions_addopen(&silence, descriptor, "/dev/null", O_WRONLY, 0);
    }
    pid_t child = -1;
    const int error = posix_spawnp(&child, words[0], &silence, nullptr, words.data(), environ);
    posix_spawn_file_actions_destroy(&silence);
    int status = -1;
    rusage usage{};
    if (error != 0 || wait4(child, &status, 0, &usage) != child || status != 0) {
      throw std::runtime_error(argv[0] + " " + argv[1] + ": does not run to its end");
    }
    return seconds(usage.ru_utime) + seconds(usage.ru_stime);
  };
}

Comparison compare(const Pair& pair, int rounds) {
  pair.ours_work();
  pair.other_work();
  std::vector<double> ours, other, ratios;
  for (int i = 0; i < rounds; ++i) {
    ours.push_back(pair.ours_work());
    other.push_back(pair.other_work());
    ratios.push_back(ours.back() / other.back());
  }
  return {at_share(ours, 0.5), at_share(other, 0.5), at_share(ratios, 0.5), at_share(ratios, 0.1),
          at_share(ratios, 0.9)};
}

}  // namespace beltgrip::test
