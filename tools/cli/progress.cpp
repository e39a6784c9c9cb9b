#include "tools/cli/progress.h"

#include <unistd.h>

#include <cstdio>

namespace beltgrip::cli {

namespace {
constexpr double kPatience_s = 2.0, kPause_s = 0.2;
}  // namespace

Progress::Progress(bool shown)
    : shown_(shown && isatty(STDERR_FILENO) != 0), next_s_(kPatience_s) {}

void Progress::tell(double done, const std::string& what, const char* rate_unit, double share) {
  const double wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  if (!shown_ || wall_s < next_s_) return;
  next_s_ = wall_s + kPause_s;
  std::fprintf(stderr, "\r\x1b[Kbeltgrip: %.0f %s, %.3g %s", done, what.c_str(), done / wall_s,
               rate_unit);
  if (share > 0.0 && share <= 1.0) {
    std::fprintf(stderr, ", %.0f s left", wall_s * (1.0 - share) / share);
  }
  std::fflush(stderr);
  on_screen_ = true;
}

void Progress::clear() {
  if (on_screen_) std::fputs("\r\x1b[K", stderr);
  on_screen_ = false;
}

}  // namespace beltgrip::cli
