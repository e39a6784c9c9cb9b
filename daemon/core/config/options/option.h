// What one key of the configuration is. One row says all of it: type, unit, range, where the value
// goes, default and meaning. The reader, its error lines, the commented default file and the
// documents come from it. Start-up and tools only.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "can_dbc/frame/can_frame.h"
#include "daemon/core/config/toml/config_document.h"
#include "daemon/core/config/toml/config_errors.h"

namespace beltgrip::daemon {

struct OptionRow {
  enum class Kind : std::uint8_t {
    kNumber,
    kInteger,
    kText,
    kChoice,
    kFlag,
    kPaths,
    kTable,  // read by a function of its own, from rows of its own
    kOther   // judged by the place that uses it: what is right depends on the DBC
  };
  static constexpr double kEndless = std::numeric_limits<double>::infinity();

  std::string_view section;  // "bus", "signals.ROLE"; as in the documents
  std::string_view key;
  Kind kind{};
  std::string_view unit;  // for the documents; the key carries it as well
  double minimum = -kEndless, maximum = kEndless;
  double factor = 1.0;                        // value in its place = value in the file * factor
  std::span<const std::string_view> choices;  // kChoice, in the order of the enumeration
  std::string_view help;                      // lines separated by '\n'
  std::string_view shown;     // as its default in the documents; empty: that of the place
  std::string_view expected;  // in an error, where type and range do not say it
  bool is_hexadecimal = false, is_nonzero = false, is_required = false;
  bool is_path = false;  // relative to the file that it stands in
};

// Target: what its section is read into.
template <typename Target>
struct OptionOf : OptionRow {
  double& (*number)(Target&) = nullptr;
  std::int64_t (*get_integer)(const Target&) = nullptr;
  void (*set_integer)(Target&, std::int64_t) = nullptr;
  std::string& (*text)(Target&) = nullptr;
  std::size_t (*get_choice)(const Target&) = nullptr;  // of a flag 0 or 1
  void (*set_choice)(Target&, std::size_t) = nullptr;
  std::vector<std::string>& (*paths)(Target&) = nullptr;
  // False when errors were added.
  bool (*table)(const std::string& key, const TomlNode&, Target&, ConfigErrors&) = nullptr;

  // What a row says beyond its type.
  constexpr OptionOf showing(std::string_view default_text) const {
    OptionOf row = *this;
    row.shown = default_text;
    return row;
  }
  constexpr OptionOf expecting(std::string_view what) const {
    OptionOf row = *this;
    row.expected = what;
    return row;
  }
  constexpr OptionOf hexadecimal() const {
    OptionOf row = *this;
    row.is_hexadecimal = true;
    return row;
  }
  constexpr OptionOf path() const {
    OptionOf row = *this;
    row.is_path = true;
    return row;
  }
  constexpr OptionOf nonzero() const {
    OptionOf row = *this;
    row.is_nonzero = true;
    return row;
  }
  constexpr OptionOf required() const {
    OptionOf row = *this;
    row.is_required = true;
    return row;
  }
};

// The rows of a table are written with these. A place is a path of members from the target on:
// number<&Config::variator, &VariatorParameters::ratio_low>(...).
namespace option_row {

template <typename Owner, typename Member>
Owner owner_of(Member Owner::*);
template <auto... Path>
struct OwnerOfFirst;
template <auto First, auto... Rest>
struct OwnerOfFirst<First, Rest...> {
  using Type = decltype(owner_of(First));
};
template <auto... Path>
using OwnerOf = typename OwnerOfFirst<Path...>::Type;

template <auto... Path, typename Target>
constexpr auto& at(Target& target) {
  return (target.*....*Path);
}

template <typename Target>
constexpr OptionOf<Target> row(OptionRow::Kind kind, std::string_view section, std::string_view key,
                               std::string_view help) {
  OptionOf<Target> row;
  row.section = section;
  row.key = key;
  row.kind = kind;
  row.help = help;
  return row;
}

template <auto... Path, typename Target = OwnerOf<Path...>>
constexpr OptionOf<Target> number(std::string_view section, std::string_view key,
                                  std::string_view unit, double minimum, double maximum,
                                  std::string_view help, double factor = 1.0) {
  OptionOf<Target> out = row<Target>(OptionRow::Kind::kNumber, section, key, help);
  out.unit = unit;
  out.minimum = minimum;
  out.maximum = maximum;
  out.factor = factor;
  out.number = [](Target& target) -> double& {
    auto& place = at<Path...>(target);
    if constexpr (std::is_same_v<decltype(place), std::optional<double>&>) {
      return place ? *place : place.emplace();
    } else {
      return place;
    }
  };
  return out;
}

template <auto... Path, typename Target = OwnerOf<Path...>>
constexpr OptionOf<Target> integer(std::string_view section, std::string_view key,
                                   std::string_view unit, double minimum, double maximum,
                                   std::string_view help) {
  OptionOf<Target> out = row<Target>(OptionRow::Kind::kInteger, section, key, help);
  out.unit = unit;
  out.minimum = minimum;
  out.maximum = maximum;
  out.get_integer = [](const Target& target) {
    const auto& place = at<Path...>(target);
    if constexpr (std::is_same_v<decltype(place), const can::CanId&>) {
      return static_cast<std::int64_t>(place.value);
    } else {
      return static_cast<std::int64_t>(place);
    }
  };
  out.set_integer = [](Target& target, std::int64_t value) {
    auto& place = at<Path...>(target);
    if constexpr (std::is_same_v<decltype(place), can::CanId&>) {
      const auto id = static_cast<std::uint32_t>(value);
      place = {id, id > can::kStandardIdMax};
    } else {
      place = static_cast<std::remove_reference_t<decltype(place)>>(value);
    }
  };
  return out;
}

template <auto... Path, typename Target = OwnerOf<Path...>>
constexpr OptionOf<Target> text(std::string_view section, std::string_view key,
                                std::string_view help) {
  OptionOf<Target> out = row<Target>(OptionRow::Kind::kText, section, key, help);
  out.text = [](Target& target) -> std::string& { return at<Path...>(target); };
  return out;
}

template <auto... Path, typename Target = OwnerOf<Path...>>
constexpr OptionOf<Target> choice(std::string_view section, std::string_view key,
                                  std::span<const std::string_view> choices,
                                  std::string_view help) {
  OptionOf<Target> out = row<Target>(OptionRow::Kind::kChoice, section, key, help);
  out.choices = choices;
  out.get_choice = [](const Target& target) {
    return static_cast<std::size_t>(at<Path...>(target));
  };
  out.set_choice = [](Target& target, std::size_t index) {
    auto& place = at<Path...>(target);
    place = static_cast<std::remove_reference_t<decltype(place)>>(index);
  };
  return out;
}

// An enumeration of two values, or a bool.
template <auto... Path>
constexpr auto flag(std::string_view section, std::string_view key, std::string_view help) {
  auto out = choice<Path...>(section, key, {}, help);
  out.kind = OptionRow::Kind::kFlag;
  return out;
}

template <auto... Path, typename Target = OwnerOf<Path...>>
constexpr OptionOf<Target> paths(std::string_view section, std::string_view key,
                                 std::string_view help) {
  OptionOf<Target> out = row<Target>(OptionRow::Kind::kPaths, section, key, help);
  out.is_path = true;
  out.paths = [](Target& target) -> std::vector<std::string>& { return at<Path...>(target); };
  return out;
}

template <typename Target>
constexpr OptionOf<Target> table(std::string_view section, std::string_view key,
                                 bool (*read)(const std::string&, const TomlNode&, Target&,
                                              ConfigErrors&),
                                 std::string_view help) {
  OptionOf<Target> out = row<Target>(OptionRow::Kind::kTable, section, key, help);
  out.table = read;
  return out;
}

template <typename Target>
constexpr OptionOf<Target> other(std::string_view section, std::string_view key,
                                 std::string_view help) {
  return row<Target>(OptionRow::Kind::kOther, section, key, help);
}

}  // namespace option_row

}  // namespace beltgrip::daemon
