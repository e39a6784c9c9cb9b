// Headless Chromium that a test drives as a user would: pages opened, the mouse moved, pictures
// taken; what the page complains of is kept. Spoken to over a pipe (DevTools protocol).
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/process.h"

namespace beltgrip::test {

class Browser {
 public:
  // folder: an empty one, for its profile. Throws std::runtime_error when Chromium does not answer.
  explicit Browser(const std::string& folder);
  ~Browser();
  Browser(const Browser&) = delete;
  Browser& operator=(const Browser&) = delete;

  void resize(int width, int height);
  void open(const std::string& file);  // and waits until it is loaded
  // The value of a JavaScript expression; a promise's is waited for.
  nlohmann::json evaluate(const std::string& expression);
  void drag(double from_x, double from_y, double to_x, double to_y);
  void double_click(double x, double y);
  void picture(const std::string& file);  // PNG of the whole page
  void print(const std::string& file);    // PDF
  // Messages of the console, exceptions, and requests for anything but the page itself.
  const std::vector<std::string>& complaints() const { return complaints_; }

 private:
  nlohmann::json call(const std::string& method, nlohmann::json parameters);
  void take_events();
  void take(const nlohmann::json& message);
  void mouse(const char* type, double x, double y, int clicks);

  std::string fifo_;
  int commands_ = -1;
  Process chromium_;
  std::size_t read_ = 0;  // of its output
  std::int64_t last_id_ = 0;
  std::string session_, page_;
  bool loaded_ = false;
  nlohmann::json answer_;
  std::vector<std::string> complaints_;
};

}  // namespace beltgrip::test
