#include "daemon/core/config/options/config_learned.h"

#include <algorithm>
#include <functional>

#include "can_dbc/text/number_text.h"
#include "daemon/core/config/options/option_reader.h"

namespace beltgrip::daemon {
namespace {

using estimator::LearnedTerm;

std::vector<std::string> point_names() {
  return {estimator::kLearnedPoints.begin(), estimator::kLearnedPoints.end()};
}

std::vector<std::string> role_names() {
  std::vector<std::string> out;
  out.reserve(estimator::kLearnedRoles.size());
  for (const estimator::LearnedRole& each : estimator::kLearnedRoles) out.emplace_back(each.role);
  return out;
}

std::string list(const double* values, std::size_t count) {
  std::string out = "[";
  for (std::size_t i = 0; i < count; ++i) out += (i == 0 ? "" : ", ") + number_text(values[i]);
  return out + "]";
}

class Section {
 public:
  Section(const TomlNode& node, ModelLearned& into, ConfigErrors& errors)
      : node_(node), where_(key_of("learned", node.key)), into_(into), errors_(errors) {}

  bool read() {
    constexpr std::array kKeys{"acts_on",    "depends_on", "knots", "values",
                               "covariance", "box",        "law"};
    for (const TomlNode& each : node_.children) {
      if (std::find(kKeys.begin(), kKeys.end(), each.key) == kKeys.end()) {
        add_unknown_key(where_, each, {kKeys.begin(), kKeys.end()}, errors_);
        good_ = false;
      }
    }
    read_points();
    read_numbers("knots", into_.knots);
    read_numbers("values", into_.values);
    read_numbers("covariance", into_.covariance);
    read_box();
    if (good_) check();
    return good_;
  }

 private:
  void fail(const TomlNode* at, const std::string& key, const std::string& found,
            const std::string& expected) {
    errors_.add(at == nullptr ? node_.line : at->line, key_of(where_, key), found, expected);
    good_ = false;
  }

  void read_points() {
    const TomlNode* on = node_.find("acts_on");
    const auto names = point_names();
    if (on == nullptr || std::find(names.begin(), names.end(), on->text) == names.end()) {
      fail(on, "acts_on", on == nullptr ? "none" : on->found(), "one of " + names_text(names));
    } else {
      into_.acts_on = on->text;
    }
    const TomlNode* by = node_.find("depends_on");
    const std::string role =
        by != nullptr && by->type == TomlType::kArray && by->children.size() == 1
            ? by->children.front().text
            : "";
    if (!estimator::learned_variable(role)) {
      fail(by, "depends_on", by == nullptr ? "none" : by->found(),
           "a list of one role: " + names_text(role_names()));
    } else {
      into_.depends_on = {role};
    }
    if (const TomlNode* law = node_.find("law")) into_.law = law->text;
  }

  // Lists in lists one behind the other.
  void append(const TomlNode& list, const char* key, std::vector<double>& into) {
    for (const TomlNode& each : list.children) {
      if (each.type == TomlType::kArray) {
        append(each, key, into);
      } else if (each.is_number()) {
        into.push_back(each.number);
      } else {
        fail(&each, key, each.found(), "a number");
      }
    }
  }
  void read_numbers(const char* key, std::vector<double>& into) {
    const TomlNode* list = node_.find(key);
    if (list == nullptr) return;
    if (list->type == TomlType::kArray) {
      append(*list, key, into);
    } else {
      fail(list, key, list->found(), "a list of numbers");
    }
  }

  void read_box() {
    const TomlNode* box = node_.find("box");
    if (box == nullptr) return;
    for (const TomlNode& each : box->children) {
      const bool is_range = each.children.size() == 2 && each.children[0].is_number() &&
                            each.children[1].is_number() &&
                            each.children[0].number < each.children[1].number;
      if (is_range) {
        into_.box[each.key] = {each.children[0].number, each.children[1].number};
      } else {
        fail(&each, key_of("box", each.key), each.found(), "[lowest, highest]");
      }
    }
  }

  void check() {
    const std::size_t n = into_.knots.size();
    if (n < 2 || n > LearnedTerm::kKnotsMax ||
        std::adjacent_find(into_.knots.begin(), into_.knots.end(), std::greater_equal<>()) !=
            into_.knots.end()) {
      fail(node_.find("knots"), "knots", std::to_string(n) + " numbers",
           "2 to " + std::to_string(LearnedTerm::kKnotsMax) + " numbers, each above the last");
    } else if (into_.values.size() != n) {
      fail(node_.find("values"), "values", std::to_string(into_.values.size()) + " numbers",
           std::to_string(n) + ", one for each knot");
    } else if (!into_.covariance.empty() && into_.covariance.size() != n * n) {
      fail(node_.find("covariance"), "covariance",
           std::to_string(into_.covariance.size()) + " numbers",
           std::to_string(n) + " rows of " + std::to_string(n));
    }
  }

  const TomlNode& node_;
  std::string where_;
  ModelLearned& into_;
  ConfigErrors& errors_;
  bool good_ = true;
};

}  // namespace

bool read_learned(const TomlNode& section, ModelLearned& into, ConfigErrors& errors) {
  return Section(section, into, errors).read();
}

std::string learned_text(const std::string& name, const ModelLearned& learned) {
  std::string out = "\n[learned." + name + "]\nacts_on = \"" + learned.acts_on + "\"\n";
  out += "depends_on = [\"" + learned.depends_on.front() + "\"]\n";
  const std::size_t n = learned.knots.size();
  out += "knots = " + list(learned.knots.data(), n) + "\n";
  out += "values = " + list(learned.values.data(), n) + "\n";
  if (!learned.covariance.empty()) {
    out += "covariance = [";
    for (std::size_t i = 0; i < n; ++i) {
      out += (i == 0 ? "" : ",\n  ") + list(learned.covariance.data() + i * n, n);
    }
    out += "]\n";
  }
  std::string box;
  for (const auto& [role, range] : learned.box) {
    box += (box.empty() ? "" : ", ") + role + " = " + list(range.data(), 2);
  }
  if (!box.empty()) out += "box = { " + box + " }\n";
  if (!learned.law.empty()) out += "law = \"" + learned.law + "\"\n";
  return out;
}

LearnedTerm term_of(const std::string& name, const ModelLearned& learned) {
  LearnedTerm out;
  std::copy_n(name.begin(), std::min(name.size(), out.name.size() - 1), out.name.begin());
  const auto& points = estimator::kLearnedPoints;
  const auto point = std::find(points.begin(), points.end(), learned.acts_on);
  out.point = static_cast<estimator::LearnedPoint>(point - points.begin());
  out.variable = estimator::learned_variable(learned.depends_on.front())
                     .value_or(estimator::LearnedVariable::kOilTemperature);
  out.count = std::min(learned.knots.size(), LearnedTerm::kKnotsMax);
  std::copy_n(learned.knots.begin(), out.count, out.knot.begin());
  std::copy_n(learned.values.begin(), out.count, out.value.begin());
  return out;
}

}  // namespace beltgrip::daemon
