#include "tools/sim/scenario_reader.h"

#include <toml++/toml.h>

#include <algorithm>
#include <sstream>

#include "can_dbc/text/number_text.h"

namespace beltgrip::sim {

namespace {

std::string found_text(const toml::node& node) {
  if (const auto* number = node.as_floating_point()) return number_text(number->get());
  std::ostringstream out;
  node.visit([&out](const auto& value) { out << value; });
  std::string text = out.str();
  if (const auto line_end = text.find('\n'); line_end != std::string::npos) {
    text = text.substr(0, line_end) + "...";
  }
  return text;
}

}  // namespace

ScenarioLayer setting_layer(const std::string& key_and_value) {
  ScenarioLayer layer{"--set " + key_and_value, key_and_value};
  const auto equals = key_and_value.find('=');
  if (equals == std::string::npos) return layer;
  try {
    static_cast<void>(toml::parse(key_and_value));
  } catch (const toml::parse_error&) {
    layer.text = key_and_value.substr(0, equals) + "=\"" + key_and_value.substr(equals + 1) + "\"";
  }
  return layer;
}

struct ScenarioReader::Impl {
  // Takes the value of a key; reports a wrong one by the text that follows "found ...".
  using Take = std::function<std::string(const toml::node&)>;

  std::string unknown;
  std::map<std::string, Take> keys;
  std::map<std::string, std::function<void(ScenarioReader*)>> rows;
  struct Sections {
    std::string unknown;
    std::function<void(const std::string&, ScenarioReader&)> begin;
  };
  std::map<std::string, Sections> sections;
  std::map<std::string, std::string> positions;  // of the last value of each key
  std::string source;

  // File and line; an argument of the command line stands for itself.
  std::string place(const toml::node& node) const {
    return source.starts_with("--") ? source
                                    : source + ":" + std::to_string(node.source().begin.line);
  }

  static std::string row_name(const std::string& name, std::size_t row) {
    return name + "[" + std::to_string(row) + "]";
  }

  bool is_section(const std::string& name) const {
    const std::string prefix = name + ".";
    const auto inside = [&prefix](const auto& key) { return key.first.starts_with(prefix); };
    return std::any_of(keys.begin(), keys.end(), inside) ||
           std::any_of(rows.begin(), rows.end(), inside);
  }

  void apply_rows(const std::string& name, const toml::node& node,
                  const std::function<void(ScenarioReader*)>& begin,
                  std::vector<std::string>& errors) {
    const toml::array* array = node.as_array();
    if (array == nullptr || !std::all_of(array->begin(), array->end(),
                                         [](const toml::node& row) { return row.is_table(); })) {
      errors.push_back(place(node) + ": " + name + ": found " + found_text(node) +
                       ", expected sections [[" + name + "]]");
      return;
    }
    begin(nullptr);
    std::size_t index = 0;
    for (const toml::node& row : *array) {
      positions[row_name(name, index++)] = place(row);
      ScenarioReader reader(unknown);
      begin(&reader);
      reader.impl_->source = source;
      reader.impl_->apply_table(*row.as_table(), "", name + ".", errors);
    }
  }

  void apply_sections(const std::string& name, const toml::node& node, const Sections& kind,
                      std::vector<std::string>& errors) {
    const toml::table* sections_of_file = node.as_table();
    if (sections_of_file == nullptr) {
      errors.push_back(wrong(node, name, "sections [" + name + ".NAME]"));
      return;
    }
    for (const auto& [key, section] : *sections_of_file) {
      const std::string shown = name + "." + std::string(key.str());
      if (!section.is_table()) {
        errors.push_back(wrong(section, shown, "a section [" + shown + "]"));
        continue;
      }
      positions[shown] = place(section);
      ScenarioReader reader(kind.unknown);
      kind.begin(std::string(key.str()), reader);
      reader.impl_->source = source;
      reader.impl_->apply_table(*section.as_table(), "", shown + ".", errors);
    }
  }

  std::string wrong(const toml::node& node, const std::string& shown,
                    const std::string& expected) const {
    return place(node) + ": " + shown + ": found " + found_text(node) + ", expected " + expected;
  }

  void apply_table(const toml::table& table, const std::string& prefix,
                   const std::string& shown_prefix, std::vector<std::string>& errors) {
    for (const auto& [key, node] : table) {
      const std::string name = prefix + std::string(key.str());
      const std::string shown = shown_prefix + std::string(key.str());
      if (const auto row = rows.find(name); row != rows.end()) {
        apply_rows(shown, node, row->second, errors);
      } else if (const auto many = sections.find(name); many != sections.end()) {
        apply_sections(shown, node, many->second, errors);
      } else if (const auto value = keys.find(name); value != keys.end() && !node.is_table()) {
        positions[name] = place(node);
        const std::string expected = value->second(node);
        if (!expected.empty()) errors.push_back(wrong(node, shown, expected));
      } else if (!is_section(name)) {
        errors.push_back(place(node) + ": " + shown + ": is not a key of " + unknown);
      } else if (const toml::table* section = node.as_table()) {
        apply_table(*section, name + ".", shown + ".", errors);
      } else {
        errors.push_back(wrong(node, shown, "a section [" + shown + "]"));
      }
    }
  }
};

ScenarioReader::ScenarioReader(std::string unknown) : impl_(std::make_unique<Impl>()) {
  impl_->unknown = std::move(unknown);
}
ScenarioReader::~ScenarioReader() = default;

void ScenarioReader::number(std::string name, double& target, double minimum, double maximum,
                            std::string reason, double factor, double shift) {
  impl_->keys[std::move(name)] = [&target, minimum, maximum, reason = std::move(reason), factor,
                                  shift](const toml::node& node) -> std::string {
    const auto value = node.is_number() ? node.value<double>() : std::nullopt;
    if (!value || !(*value >= minimum && *value <= maximum)) {
      return "a number from " + number_text(minimum) + " to " + number_text(maximum) + ": " +
             reason;
    }
    target = *value * factor + shift;
    return {};
  };
}

void ScenarioReader::text(std::string name, std::string& target) {
  impl_->keys[std::move(name)] = [&target](const toml::node& node) -> std::string {
    const auto value = node.value<std::string>();
    if (!value) return "text";
    target = *value;
    return {};
  };
}

void ScenarioReader::flag(std::string name, bool& target) {
  impl_->keys[std::move(name)] = [&target](const toml::node& node) -> std::string {
    if (!node.is_boolean()) return "true or false";
    target = *node.value<bool>();
    return {};
  };
}

void ScenarioReader::choice(std::string name, std::vector<std::string> choices,
                            std::function<void(std::size_t)> take) {
  impl_->keys[std::move(name)] = [choices = std::move(choices),
                                  take = std::move(take)](const toml::node& node) -> std::string {
    const std::string value = node.value_or(std::string());
    std::string expected;
    for (std::size_t i = 0; i < choices.size(); ++i) {
      if (value == choices[i]) {
        take(i);
        return {};
      }
      expected += (expected.empty() ? "one of \"" : ", \"") + choices[i] + "\"";
    }
    return expected;
  };
}

void ScenarioReader::rows(std::string name, std::function<void(ScenarioReader* row)> begin) {
  impl_->rows[std::move(name)] = std::move(begin);
}

void ScenarioReader::sections(
    std::string name, std::string unknown,
    std::function<void(const std::string& any, ScenarioReader& section)> begin) {
  impl_->sections[std::move(name)] = {std::move(unknown), std::move(begin)};
}

void ScenarioReader::apply(const ScenarioLayer& layer) {
  impl_->source = layer.source;
  toml::table table;
  try {
    table = toml::parse(layer.text);
  } catch (const toml::parse_error& error) {
    errors_.push_back((layer.source.starts_with("--")
                           ? layer.source
                           : layer.source + ":" + std::to_string(error.source().begin.line)) +
                      ": not TOML: " + std::string(error.description()));
    return;
  }
  impl_->apply_table(table, "", "", errors_);
}

void ScenarioReader::contradiction(const std::string& name, const std::string& text) {
  errors_.push_back(impl_->positions.at(name) + ": " + name + ": " + text);
}

void ScenarioReader::row_contradiction(const std::string& name, std::size_t row,
                                       const std::string& text) {
  errors_.push_back(impl_->positions.at(Impl::row_name(name, row)) + ": " + name + ": " + text);
}

}  // namespace beltgrip::sim
