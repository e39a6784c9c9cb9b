#include "tests/support/browser.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <stdexcept>

namespace beltgrip::test {
namespace {

using nlohmann::json;

constexpr Milliseconds kLimit{120'000};  // a busy machine, with sanitizers

// Chromium takes commands from descriptor 3 and answers on 4: its standard input and output here.
std::vector<std::string> command_line(const std::string& folder) {
  const std::string exec =
      "exec chromium-headless-shell --no-sandbox --disable-gpu --disable-dev-shm-usage "
      "--no-first-run --disable-extensions --disable-background-networking "
      "--remote-debugging-pipe --user-data-dir=\"$1\" about:blank "
      "3<&0 4>&1 0</dev/null 1>/dev/null";
  return {"sh", "-c", exec, "sh", folder};
}

std::string made_fifo(const std::string& path) {
  if (mkfifo(path.c_str(), 0600) != 0) throw std::runtime_error("mkfifo " + path);
  return path;
}

std::string bytes_of(const std::string& base64) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  unsigned bits = 0;
  int count = 0;
  for (const char c : base64) {
    const std::size_t digit = kDigits.find(c);
    if (digit == std::string_view::npos) break;
    bits = bits << 6 | static_cast<unsigned>(digit);
    count += 6;
    if (count < 8) continue;
    count -= 8;
    out += static_cast<char>(bits >> count & 255U);
  }
  return out;
}

void write_bytes(const std::string& file, const json& base64) {
  std::ofstream(file, std::ios::binary) << bytes_of(base64.get<std::string>());
}

}  // namespace

Browser::Browser(const std::string& folder)
    : fifo_(made_fifo(folder + ".commands")),
      commands_(::open(fifo_.c_str(), O_RDWR | O_CLOEXEC)),
      chromium_(command_line(folder), fifo_) {
  const json target = call("Target.createTarget", {{"url", "about:blank"}});
  session_ = call("Target.attachToTarget", {{"targetId", target.at("targetId")}, {"flatten", true}})
                 .at("sessionId");
  for (const char* domain : {"Page", "Runtime", "Log", "Network"}) {
    call(domain + std::string(".enable"), json::object());
  }
}

// Closed by its own means it waits for its other processes, which write into its folder.
Browser::~Browser() {
  session_.clear();
  try {
    call("Browser.close", json::object());
  } catch (const std::runtime_error&) {  // it is gone already, and the test has said so
  }
  chromium_.wait(Milliseconds{10'000});
  close(commands_);
}

json Browser::call(const std::string& method, json parameters) {
  json message{{"id", ++last_id_}, {"method", method}, {"params", std::move(parameters)}};
  if (!session_.empty()) message["sessionId"] = session_;
  const std::string text = message.dump() + '\0';
  if (write(commands_, text.data(), text.size()) != static_cast<ssize_t>(text.size())) {
    throw std::runtime_error(method + ": not written");
  }
  answer_ = nullptr;
  const bool answered = chromium_.wait_until(
      [this](const Process&) {
        take_events();
        return !answer_.is_null();
      },
      kLimit);
  if (!answered) throw std::runtime_error(method + ": no answer; " + chromium_.err());
  if (answer_.contains("error")) throw std::runtime_error(method + ": " + answer_.dump());
  return answer_.at("result");
}

void Browser::take_events() {
  const std::string& out = chromium_.out();
  for (std::size_t end; (end = out.find('\0', read_)) != std::string::npos; read_ = end + 1) {
    take(json::parse(out.begin() + static_cast<std::ptrdiff_t>(read_),
                     out.begin() + static_cast<std::ptrdiff_t>(end)));
  }
}

void Browser::take(const json& message) {
  if (message.contains("id")) {
    if (message.at("id") == last_id_) answer_ = message;
    return;
  }
  const std::string method = message.at("method");
  const json& what = message.at("params");
  if (method == "Page.loadEventFired") {
    loaded_ = true;
  } else if (method == "Network.requestWillBeSent") {
    const std::string url = what.at("request").at("url");
    if (url != page_ && !url.starts_with("data:")) complaints_.push_back("asks for " + url);
  } else if (method == "Runtime.consoleAPICalled" || method == "Runtime.exceptionThrown" ||
             method == "Log.entryAdded") {
    complaints_.push_back(what.dump());
  }
}

void Browser::resize(int width, int height) {
  call("Emulation.setDeviceMetricsOverride",
       {{"width", width}, {"height", height}, {"deviceScaleFactor", 1}, {"mobile", false}});
}

void Browser::open(const std::string& file) {
  page_ = "file://" + file;
  loaded_ = false;
  call("Page.navigate", {{"url", page_}});
  const bool loaded = chromium_.wait_until(
      [this](const Process&) {
        take_events();
        return loaded_;
      },
      kLimit);
  if (!loaded) throw std::runtime_error(page_ + ": not loaded");
}

json Browser::evaluate(const std::string& expression) {
  const json answer =
      call("Runtime.evaluate",
           {{"expression", expression}, {"returnByValue", true}, {"awaitPromise", true}});
  if (answer.contains("exceptionDetails")) throw std::runtime_error(answer.dump());
  const json& result = answer.at("result");
  return result.contains("value") ? result.at("value") : json();
}

void Browser::mouse(const char* type, double x, double y, int clicks) {
  const bool held = type != std::string_view("mouseMoved") || clicks > 0;
  call("Input.dispatchMouseEvent", {{"type", type},
                                    {"x", x},
                                    {"y", y},
                                    {"button", held ? "left" : "none"},
                                    {"buttons", held ? 1 : 0},
                                    {"clickCount", clicks}});
}

void Browser::drag(double from_x, double from_y, double to_x, double to_y) {
  mouse("mouseMoved", from_x, from_y, 0);
  mouse("mousePressed", from_x, from_y, 1);
  mouse("mouseMoved", 0.5 * (from_x + to_x), 0.5 * (from_y + to_y), 1);
  mouse("mouseMoved", to_x, to_y, 1);
  mouse("mouseReleased", to_x, to_y, 1);
}

void Browser::double_click(double x, double y) {
  for (const int clicks : {1, 2}) {
    mouse("mousePressed", x, y, clicks);
    mouse("mouseReleased", x, y, clicks);
  }
}

void Browser::picture(const std::string& file) {
  write_bytes(file, call("Page.captureScreenshot", {{"captureBeyondViewport", true}}).at("data"));
}

void Browser::print(const std::string& file) {
  write_bytes(file, call("Page.printToPDF", {{"printBackground", true}}).at("data"));
}

}  // namespace beltgrip::test
