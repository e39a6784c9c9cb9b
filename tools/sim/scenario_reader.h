// Reads TOML keys into values that have been named before: type, range and physical reason of each
// in one line. Every mistake is listed with file, line, key and reason. Tools only.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace beltgrip::sim {

struct ScenarioLayer {
  std::string source;  // name for messages
  std::string text;    // TOML
};

// "key=value" of the command line as a layer; text needs no quotes there.
ScenarioLayer setting_layer(const std::string& key_and_value);

class ScenarioReader {
 public:
  // What is said of a key that none has named: "is not a key of ...".
  explicit ScenarioReader(std::string unknown);
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
  // [name.ANY]: a later layer adds to them. begin names the keys of the one that is called `any`.
  void sections(std::string name, std::string unknown,
                std::function<void(const std::string& any, ScenarioReader& section)> begin);

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

}  // namespace beltgrip::sim
