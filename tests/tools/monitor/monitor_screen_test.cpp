// beltgrip monitor in a terminal (tmux): what is seen at two sizes, the keys, and that the terminal
// is given back on every way out.
#include <csignal>
#include <functional>

#include <gtest/gtest.h>

#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

constexpr Milliseconds kLimit{20'000};

class Terminal {
 public:
  // Runs `line` in a shell, on a terminal of this size.
  Terminal(const Workplace& place, const std::string& line, int columns, int rows)
      : socket_(place.path("tmux" + std::to_string(++count_))) {
    tmux({"-f", "/dev/null", "new-session", "-d", "-x", std::to_string(columns), "-y",
          std::to_string(rows), "env TZ=UTC sh -c '" + line + "'"});
  }
  ~Terminal() { tmux({"kill-server"}); }

  void keys(const std::vector<std::string>& keys) const {
    std::vector<std::string> all{"send-keys"};
    all.insert(all.end(), keys.begin(), keys.end());
    tmux(all);
  }
  void resize(int columns, int rows) const {
    tmux({"resize-window", "-x", std::to_string(columns), "-y", std::to_string(rows)});
  }
  std::string screen() const { return tmux({"capture-pane", "-p"}); }
  std::string is(const std::string& format) const {
    const std::string text = tmux({"display-message", "-p", "#{" + format + "}"});
    return text.substr(0, text.find('\n'));
  }
  // Until the screen is as wanted; what it was last.
  std::string wait(const std::function<bool(const std::string&)>& done) const {
    const auto end = std::chrono::steady_clock::now() + kLimit;
    std::string seen;
    do {
      seen = screen();
    } while (!done(seen) && std::chrono::steady_clock::now() < end);
    return seen;
  }
  std::string wait_for(const std::string& text) const {
    return wait([&](const std::string& seen) { return seen.find(text) != std::string::npos; });
  }

 private:
  std::string tmux(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), {"tmux", "-S", socket_});
    return run(arguments, kLimit).out;
  }
  static inline int count_ = 0;  // a server that ends takes its socket with it
  std::string socket_;
};

class Screen : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    place_ = new Workplace;
    ASSERT_EQ(
        beltgrip({"simulate", "--scenario", "demo", "--out-dir", place_->path("drive")}).status, 0);
  }
  static void TearDownTestSuite() {
    delete place_;
    place_ = nullptr;
  }
  static std::string command(const std::string& options) {
    return program_path() + " monitor " + place_->path("drive/trace.log") + " --config " +
           place_->path("drive/beltgrip.toml") + " " + options;
  }
  static bool has(const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  }

  // A picture is painted from above, and may be seen half done: with its last line it is whole.
  static bool has_all(const std::string& text, const std::string& part) {
    return has(text, part) && has(text, "q quit");
  }

  static Workplace* place_;
};
Workplace* Screen::place_ = nullptr;

// Ends in the first experiment, long before the log does, and stands still there.
TEST_F(Screen, ShowsTheExperimentAt80x24) {
  const Terminal terminal(*place_, command("--from 11.5 --duration 0.5; echo ENDED; cat"), 80, 24);
  const std::string seen = terminal.wait(
      [](const std::string& text) { return has_all(text, "end of --duration, at 12.0 s"); });
  for (const char* part :
       {"trace.log", "ramping", "excited", "primary_speed", "slip sigma*", "asked", "q quit"}) {
    EXPECT_TRUE(has(seen, part)) << part << "\n" << seen;
  }
  EXPECT_EQ(terminal.is("alternate_on"), "1");
  terminal.keys({"q"});
  EXPECT_TRUE(has(terminal.wait_for("ENDED"), "ENDED"));
}

TEST_F(Screen, FollowsTheTerminalsSize) {
  const Terminal terminal(*place_, command("--from 30"), 80, 24);
  const std::string small = terminal.wait_for("slope");
  EXPECT_FALSE(has(small, "experiment_permitted")) << small;  // cut
  terminal.resize(200, 60);
  const std::string large =
      terminal.wait([](const std::string& text) { return has_all(text, "experiment_permitted"); });
  EXPECT_TRUE(has(large, "experiment_permitted")) << large;
  EXPECT_TRUE(has(large, "q quit")) << large;
}

TEST_F(Screen, PausesStepsAndSeeks) {
  const Terminal terminal(*place_, command("--from 20 --speed 0.01"), 80, 24);
  terminal.wait_for("0.01x, at 20.0 s");
  terminal.keys({"Space"});
  EXPECT_TRUE(has(terminal.wait_for("paused"), "paused, at 20."));
  terminal.keys({"Left"});
  EXPECT_TRUE(has(terminal.wait_for("at 10."), "paused, at 10."));
  terminal.keys({"Right", "s"});
  EXPECT_TRUE(has(terminal.wait_for("at 20.1"), "paused, at 20.1"));
  terminal.keys({"NPage"});
  EXPECT_TRUE(has(terminal.wait_for("end of the log"), "end of the log"));
  terminal.keys({"Home", "+", "Space"});
  EXPECT_TRUE(has(terminal.wait_for("0.02x"), "0.02x, at 0."));
}

// The shell that follows says how it found the terminal.
TEST_F(Screen, GivesTheTerminalBackOnEveryWayOut) {
  for (const int number : {0, SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGABRT, SIGSEGV}) {
    const Terminal terminal(
        *place_, "(exec " + command("--speed 0.01") + "); echo STATUS $?; stty -a; echo ENDED; cat",
        100, 40);
    ASSERT_TRUE(has(terminal.wait_for("q quit"), "q quit")) << number;
    if (number == 0) {
      terminal.keys({"q"});
    } else {
      run({"sh", "-c",
           "kill -" + std::to_string(number) + " $(pgrep -P " + terminal.is("pane_pid") + ")"},
          kLimit);
    }
    const std::string seen = terminal.wait_for("ENDED");
    ASSERT_TRUE(has(seen, "ENDED")) << number << "\n" << seen;
    EXPECT_TRUE(has(seen, " echo ")) << number << "\n" << seen;
    EXPECT_TRUE(has(seen, " icanon ")) << number << "\n" << seen;
    EXPECT_EQ(terminal.is("alternate_on"), "0") << number;
    EXPECT_EQ(terminal.is("cursor_flag"), "1") << number;
  }
}

TEST_F(Screen, NeedsNoColour) {
  const Terminal terminal(*place_, "NO_COLOR=1 " + command("--speed 0.01"), 80, 24);
  EXPECT_TRUE(has(terminal.wait_for("q quit"), "trace.log"));
  const Terminal plain(*place_, "TERM=vt100 " + command("--speed 0.01"), 80, 24);
  EXPECT_TRUE(has(plain.wait_for("q quit"), "trace.log"));
}

}  // namespace
}  // namespace beltgrip::test
