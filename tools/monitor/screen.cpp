#include "tools/monitor/screen.h"

#include <curses.h>
#include <signal.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <initializer_list>
#include <stdexcept>
#include <string>

namespace beltgrip::monitor {

namespace {

// Colours by number, so that Tone and its pair are the same.
constexpr std::array<short, 6> kColours{-1, -1, -1, COLOR_GREEN, COLOR_YELLOW, COLOR_RED};

constexpr int kEscape_ms = 25;  // what comes later than this after Escape is another key

// What gives the terminal back, ready for a signal's handler.
struct Restoring {
  std::atomic<bool> open{false};
  termios before{};
  std::array<char, 256> text{};
  std::size_t length = 0;
};
Restoring restoring;

void append(const char* capability) {
  const char* text = tigetstr(capability);
  // -1: no capability that is a string.
  if (text == nullptr || reinterpret_cast<std::intptr_t>(text) == -1) return;
  const std::size_t length = std::strlen(text);
  if (restoring.length + length > restoring.text.size()) return;
  std::memcpy(restoring.text.data() + restoring.length, text, length);
  restoring.length += length;
}

void on_crash(int number) {
  Screen::restore();
  signal(number, SIG_DFL);
  raise(number);
}

void watch_crashes() {
  for (const int number : {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGQUIT}) {
    signal(number, on_crash);
  }
}

attr_t attributes(Tone tone) {
  const attr_t colour =
      has_colors() ? COLOR_PAIR(static_cast<int>(tone)) : static_cast<attr_t>(A_NORMAL);
  switch (tone) {
    case Tone::kPlain:
    case Tone::kGood:
      return colour;
    case Tone::kDim:
      return colour | A_DIM;
    case Tone::kStrong:
    case Tone::kWarning:
      return colour | A_BOLD;
    case Tone::kAlarm:
      return colour | A_BOLD | (has_colors() ? A_NORMAL : A_REVERSE);
  }
  return colour;
}

void begin_colours() {
  const char* none = std::getenv("NO_COLOR");
  if ((none != nullptr && *none != '\0') || !has_colors()) return;
  start_color();
  use_default_colors();
  for (std::size_t i = 1; i < kColours.size(); ++i) {
    init_pair(static_cast<short>(i), kColours[i], -1);
  }
}

}  // namespace

bool Screen::possible() {
  const char* terminal = std::getenv("TERM");
  return isatty(STDIN_FILENO) != 0 && isatty(STDOUT_FILENO) != 0 && terminal != nullptr &&
         *terminal != '\0' && std::strcmp(terminal, "dumb") != 0;
}

Screen::Screen() {
  tcgetattr(STDIN_FILENO, &restoring.before);
  restoring.length = 0;
  if (newterm(nullptr, stdout, stdin) == nullptr) {
    throw std::runtime_error(std::string("TERM=") + std::getenv("TERM") +
                             " is a terminal that terminfo does not know");
  }
  for (const char* capability : {"sgr0", "cnorm", "rmkx", "rmcup"}) append(capability);
  restoring.open.store(true);
  watch_crashes();
  begin_colours();
  cbreak();
  noecho();
  keypad(stdscr, TRUE);
  nodelay(stdscr, TRUE);
  set_escdelay(kEscape_ms);
  curs_set(0);
}

Screen::~Screen() {
  endwin();
  restoring.open.store(false);
}

void Screen::restore() noexcept {
  if (!restoring.open.exchange(false)) return;
  static_cast<void>(!write(STDOUT_FILENO, restoring.text.data(), restoring.length));
  tcsetattr(STDIN_FILENO, TCSANOW, &restoring.before);
}

Size Screen::size() const { return {getmaxx(stdscr), getmaxy(stdscr)}; }

void Screen::draw(const std::vector<Line>& lines) {
  erase();
  int row = 0;
  for (const Line& line : lines) {
    move(row++, 0);
    for (const Piece& piece : line) {
      attrset(static_cast<int>(attributes(piece.tone)));
      addnstr(piece.text.data(), static_cast<int>(piece.text.size()));
    }
  }
  refresh();
}

std::optional<Key> Screen::key() {
  switch (getch()) {
    case 'q':
    case 'Q':
      return Key::kQuit;
    case ' ':
    case 'p':
      return Key::kPause;
    case 's':
    case '.':
      return Key::kStep;
    case KEY_LEFT:
      return Key::kBack;
    case KEY_RIGHT:
      return Key::kOn;
    case KEY_PPAGE:
      return Key::kFarBack;
    case KEY_NPAGE:
      return Key::kFarOn;
    case KEY_HOME:
      return Key::kBegin;
    case '+':
    case '=':
      return Key::kFaster;
    case '-':
      return Key::kSlower;
    case KEY_RESIZE:
      return Key::kResized;
    default:
      return std::nullopt;
  }
}

}  // namespace beltgrip::monitor
