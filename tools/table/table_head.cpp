#include "tools/table/table_head.h"

#include <algorithm>
#include <array>
#include <map>

#include "can_dbc/log/can_log.h"
#include "can_dbc/text/unit_text.h"
#include "tools/table/table_text.h"

namespace beltgrip::table {

namespace {

constexpr int kLinesLooked = 60;
constexpr std::size_t kColumnsLeast = 2, kColumnsMost = 4096;
constexpr std::size_t kTextsMost = 64;
constexpr int kDecimalsMost = 9;
constexpr std::uint32_t kFirstId = 0x1FFF0000;
constexpr double kRange = 1e9;  // with nine decimals the 64 bits hold it

struct TimeUnit {
  std::string_view text;
  std::int64_t ns;
};
constexpr std::array kTimeUnits{TimeUnit{"s", 1'000'000'000},
                                TimeUnit{"sec", 1'000'000'000},
                                TimeUnit{"seconds", 1'000'000'000},
                                TimeUnit{"ms", 1'000'000},
                                TimeUnit{"us", 1'000},
                                TimeUnit{"µs", 1'000},
                                TimeUnit{"ns", 1},
                                TimeUnit{"min", 60'000'000'000},
                                TimeUnit{"h", 3'600'000'000'000}};
constexpr std::array<std::string_view, 6> kTimeNames{"t",    "time",     "timestamp",
                                                     "zeit", "datetime", "seconds"};

std::optional<std::int64_t> time_unit(std::string_view text) {
  for (const TimeUnit& each : kTimeUnits) {
    if (each.text == text) return each.ns;
  }
  return {};
}

bool is_name(std::string_view cell, char separator) {
  const bool printable = std::none_of(cell.begin(), cell.end(), [](char c) {
    return static_cast<unsigned char>(c) < ' ' || c == '\x7f';
  });
  return printable && !is_missing(cell) && !number_of(cell, separator);
}

// "Speed [rpm]", "Speed (rpm)", "t[s]"; parentheses that hold no unit belong to the name.
Column column_of(std::string_view cell) {
  Column column;
  column.name = cell;
  const std::size_t square = cell.find('['), round = cell.rfind('(');
  if (square != std::string_view::npos && cell.ends_with(']')) {
    column.unit = cell.substr(square + 1, cell.size() - square - 2);
    column.name = cell.substr(0, square);
  } else if (round != std::string_view::npos && cell.ends_with(')')) {
    const std::string_view unit = cell.substr(round + 1, cell.size() - round - 2);
    if (can::parse_unit(unit) || time_unit(unit)) {
      column.unit = unit;
      column.name = cell.substr(0, round);
    }
  }
  while (column.name.ends_with(' ')) column.name.pop_back();
  return column;
}

// "t", "Time", "time_ms": with the unit that the name ends in.
bool is_time(const Column& column, std::int64_t& unit_ns) {
  const std::string name = lower(column.name);
  const std::size_t mark = name.find_last_of("_ ");
  const std::string_view stem = std::string_view(name).substr(0, std::min(mark, name.size()));
  const auto suffix = mark == std::string::npos ? std::nullopt : time_unit(name.substr(mark + 1));
  const auto is_called = [](std::string_view called) {
    return std::find(kTimeNames.begin(), kTimeNames.end(), called) != kTimeNames.end();
  };
  const auto unit = time_unit(lower(column.unit));
  if (!is_called(name) && !(suffix && is_called(stem))) return false;
  unit_ns = unit ? *unit : suffix.value_or(kTimeUnits[0].ns);
  return true;
}

// Behind a preamble too, which may look like names.
bool has_frames(const std::string& path) {
  Lines lines(path);
  for (int looked = 0; looked < kLinesLooked; ++looked) {
    const auto line = lines.next();
    if (!line) return false;
    if (can::is_head_of_frames(*line)) return true;
  }
  return false;
}

class HeadReader {
 public:
  explicit HeadReader(const std::string& path) : lines_(path) {}

  std::optional<Head> read() {
    if (!find_names()) return {};
    bool first = true;
    while (const auto line = lines_.next()) {
      can::split_row(*line, head_.separator, cells_);
      if (first && take_units()) continue;
      first = false;
      if (head_.rows++ == 0) head_.first_row = lines_.number();
      take_row();
    }
    for (std::size_t i = 0; i < head_.columns.size() && !head_.time; ++i) {
      if (is_time(head_.columns[i], head_.time_unit_ns)) head_.time = i;
    }
    if (head_.rows == 0) return {};
    if (head_.time) {
      // A clock or a date needs no unit.
      const Column& time = head_.columns[*head_.time];
      head_.time_unit_unknown =
          time.numbers > 0 && !is_missing(time.unit) && !time_unit(lower(time.unit));
    }
    return std::move(head_);
  }

 private:
  bool find_names() {
    for (int looked = 0; looked < kLinesLooked; ++looked) {
      const auto line = lines_.next();
      if (!line) return false;
      for (const char separator : {',', ';', '\t'}) {
        can::split_row(*line, separator, cells_);
        if (cells_.size() < kColumnsLeast || cells_.size() > kColumnsMost) continue;
        if (!std::all_of(cells_.begin(), cells_.end(),
                         [&](std::string_view cell) { return is_name(cell, separator); })) {
          continue;
        }
        head_.separator = separator;
        for (const std::string_view cell : cells_) {
          head_.columns.push_back(column_of(cell));
          head_.columns.back().unit_line = lines_.number();
        }
        head_.width = can::RowWidth(cells_.size());
        return true;
      }
    }
    return false;
  }

  // A row without a number in which some cell is a unit.
  bool take_units() {
    bool unit = false;
    for (const std::string_view cell : cells_) {
      if (number_of(cell, head_.separator)) return false;
      unit |= can::parse_unit(cell).has_value() && !cell.empty();
    }
    if (!unit) return false;
    for (std::size_t i = 0; i < std::min(cells_.size(), head_.columns.size()); ++i) {
      if (!head_.columns[i].unit.empty()) continue;
      head_.columns[i].unit = cells_[i];
      head_.columns[i].unit_line = lines_.number();
    }
    return true;
  }

  void take_row() {
    const std::size_t columns = head_.columns.size();
    head_.width.look(cells_);
    if (can::wrong_width(cells_, columns, columns) != nullptr) return;
    for (std::size_t i = 0; i < columns; ++i) {
      Column& column = head_.columns[i];
      const std::string_view cell = cells_[i];
      if (is_missing(cell)) continue;
      if (number_of(cell, head_.separator)) {
        ++column.numbers;
        const auto decimals = decimals_of(cell, head_.separator);
        if (!decimals || (column.decimals && *decimals > kDecimalsMost)) column.decimals.reset();
        if (column.decimals) column.decimals = std::max(column.decimals, decimals);
      } else if (column.numbers == 0 && column.texts.size() < kTextsMost &&
                 std::find(column.texts.begin(), column.texts.end(), cell) == column.texts.end()) {
        column.texts.emplace_back(cell);
      }
    }
  }

  Lines lines_;
  Head head_;
  can::Cells cells_;
};

can::ValueTable values_of(std::vector<std::string> texts, can::Arena& arena) {
  constexpr std::array<std::string_view, 9> kFalse{
      "off", "no", "false", "open", "opened", "released", "inactive", "not pressed", "aus"};
  constexpr std::array<std::string_view, 9> kTrue{
      "on", "yes", "true", "closed", "locked", "pressed", "active", "engaged", "ein"};
  const auto is_in = [](const auto& words, const std::string& text) {
    return std::find(words.begin(), words.end(), lower(text)) != words.end();
  };
  std::map<std::int64_t, std::string> values;
  std::int64_t next = 2;
  std::sort(texts.begin(), texts.end());
  for (const std::string& text : texts) {
    const std::int64_t usual = is_in(kFalse, text) ? 0 : is_in(kTrue, text) ? 1 : -1;
    values[usual >= 0 && !values.contains(usual) ? usual : next++] = text;
  }
  std::vector<std::pair<std::int64_t, can::Text>> entries;
  entries.reserve(values.size());
  for (const auto& [value, text] : values) entries.emplace_back(value, arena.keep(text));
  return arena.table(entries);
}

}  // namespace

std::optional<Head> read_head(const std::string& path) {
  return has_frames(path) ? std::nullopt : HeadReader(path).read();
}

can::Database database_of(const Head& head) {
  can::Database database;
  for (std::size_t i = 0; i < head.columns.size(); ++i) {
    if (head.time == i) continue;
    const Column& column = head.columns[i];
    can::MessageDef& message = database.messages.emplace_back();
    message.name = database.arena->keep(column.name);
    message.id = {kFirstId + static_cast<std::uint32_t>(i), true};
    message.length = 8;
    can::SignalDef& signal = message.signals.emplace_back();
    signal.name = message.name;
    signal.unit = database.arena->shorten(database.arena->keep(column.unit));
    signal.length = 64;
    if (column.numbers == 0 && !column.texts.empty()) {
      signal.values = values_of(column.texts, *database.arena);
      signal.length = 16;
      const auto last = static_cast<double>(std::max<std::int64_t>(1, signal.values.back().first));
      signal.usage = database.arena->one(can::SignalUsage{0.0, last, {}});
    } else if (column.decimals) {
      signal.type = can::ValueType::kSigned;
      for (int digit = 0; digit < *column.decimals; ++digit) signal.scale /= 10.0;
      signal.usage = database.arena->one(can::SignalUsage{-kRange, kRange, {}});
    } else {
      signal.type = can::ValueType::kFloat64;
    }
  }
  return database;
}

}  // namespace beltgrip::table
