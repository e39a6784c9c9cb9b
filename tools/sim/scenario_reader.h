// Reads TOML keys into values that have been named before: type, range and physical reason of each
// in one line. Every mistake is listed with file, line, key and reason. Tools only.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "tools/sim/scenario.h"

namespace beltgrip::sim {

class ScenarioReader {
 public:
  ScenarioReader();
  ~ScenarioReader();

  // Values of the file between minimum and maximum; target = value * factor + shift.
  void number(std::string name, double& target, double minimum, double maximum, std::string reason,
              double factor = 1.0, double shift = 0.0);
  void text(std::string name, std::string& target);
  // Calls take with the index into choices.
  void choice(std::string name, std::vector<std::string> choices,
              std::function<void(std::size_t)> take);
  void flag(std::string name, bool& target);
  // [[name]]: a later layer replaces all rows. begin(nullptr) forgets them; otherwise it appends
  // one and names its keys to the reader it is given.
  void rows(std::string name, std::function<void(ScenarioReader* row)> begin);

  void apply(const ScenarioLayer& layer);
  // An error about a key as a whole, at the place where its value came from.
  void contradiction(const std::string& name, const std::string& text);
  // The same about the row of [[name]] with this index.
  void row_contradiction(const std::string& name, std::size_t row, const std::string& text);
  const std::vector<std::string>& errors() const { return errors_; }

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
  std::vector<std::string> errors_;
};

// Shortest text that reads back to the same number.
std::string number_text(double value);

}  // namespace beltgrip::sim
