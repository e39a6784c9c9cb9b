#include "tools/diagnose/data/signal_table.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>

#include "can_dbc/text/stray_stamps.h"
#include "can_dbc/text/table_row.h"
#include "can_dbc/text/unit_text.h"
#include "estimator/statistics/order.h"

namespace beltgrip::diagnose {
namespace {

std::string_view next_line(std::string_view& text) {
  const std::size_t end = text.find('\n');
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  return line;
}

std::string_view next_cell(std::string_view& line, char separator) {
  const std::size_t end = line.find(separator);
  const std::string_view cell = line.substr(0, end);
  line = end == std::string_view::npos ? std::string_view{} : line.substr(end + 1);
  return cell;
}

// Missing: an empty cell; NaN or an infinity is none either. Otherwise a number or nothing at all.
enum class Cell { kNumber, kMissing, kNotFinite, kBad };
Cell parse_number(std::string_view text, double& value) {
  text = can::bare_cell(text);
  if (text.empty()) return Cell::kMissing;
  if (text.front() == '+') text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return Cell::kBad;
  return std::isfinite(value) ? Cell::kNumber : Cell::kNotFinite;
}

struct Column {
  bool time = false;
  std::optional<Role> role;  // none: not used
  can::Unit unit;
};

std::optional<Role> role_of(std::string_view name) {
  for (std::size_t i = 0; i < daemon::kRoleCount; ++i) {
    if (daemon::role_name(static_cast<Role>(i)) == name) return static_cast<Role>(i);
  }
  return std::nullopt;
}

class CsvParser {
 public:
  CsvParser(std::string_view text, const std::string& name) : rest_(text), name_(name) {
    table_.name = name;
    if (rest_.starts_with("\xEF\xBB\xBF")) rest_.remove_prefix(3);
  }

  SignalTable parse() {
    read_header();
    look_at_width();
    while (!rest_.empty()) {
      const std::string_view line = next_line(rest_);
      ++line_;
      if (!is_row(line)) continue;
      can::split_row(line, separator_, cells_);
      read_row();
    }
    if (rows_ == 0 && first_wrong_ != nullptr) {
      line_ = first_wrong_row_;
      fail(first_wrong_);
    }
    if (rows_ == 0) {
      line_ = bad_.count > 0 ? bad_.first_line : std::max<std::size_t>(line_, 1);
      fail(has_decimal_comma_ ? "found decimal commas, expected decimal points"
                              : "no line with numbers after the header");
    }
    const struct {
      const Tally& of;
      const char *one, *many, *then;
    } all[] = {
        {long_, "line", "lines", " with more cells than the header, ignored (decimal commas?)"},
        {short_, "line", "lines", " with fewer cells than the header, ignored"},
        {bad_, "line that is not", "lines that are not", " all numbers, ignored"},
        {not_finite_, "value that is", "values that are", " not finite, left out"},
        {set_back_, "time", "times", " the clock was set back: a new stretch begins"},
        {backward_, "line", "lines", " whose time does not increase, ignored"},
    };
    for (const auto& [of, one, many, then] : all) {
      if (of.count == 0) continue;
      table_.notes.push_back(name_ + ":" + std::to_string(of.first_line) + ": " +
                             std::to_string(of.count) + " " + (of.count == 1 ? one : many) + then);
    }
    return std::move(table_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw TableError{false, name_ + ":" + std::to_string(line_) + ": " + what};
  }
  static bool is_row(std::string_view line) {
    const std::string_view bare = can::bare_cell(line);
    return !bare.empty() && bare.front() != '#';
  }

  void look_at_width() {
    width_ = can::RowWidth(columns_.size());
    for (std::string_view rest = rest_; !rest.empty();) {
      const std::string_view line = next_line(rest);
      if (!is_row(line)) continue;
      can::split_row(line, separator_, cells_);
      width_.look(cells_);
    }
  }

  void read_header() {
    std::string_view header;
    while (!rest_.empty() && (header.empty() || header.front() == '#')) {
      header = can::bare_cell(next_line(rest_));
      ++line_;
    }
    separator_ = header.find(';') != std::string_view::npos    ? ';'
                 : header.find(',') != std::string_view::npos  ? ','
                 : header.find('\t') != std::string_view::npos ? '\t'
                                                               : ',';
    bool has_time = false;
    while (!header.empty()) {
      const std::string_view cell = can::bare_cell(next_cell(header, separator_));
      columns_.push_back(read_column(cell));
      if (columns_.back().time) time_ = columns_.size() - 1;
      has_time |= columns_.back().time;
    }
    if (!has_time) fail("no column t[s]; expected a header such as t[s],primary_speed[rad/s],...");
  }

  Column read_column(std::string_view cell) {
    const std::size_t open = cell.find('[');
    const std::string_view name = can::bare_cell(cell.substr(0, open));
    Column column;
    if (name == "t") {
      column.time = true;
      const std::string_view unit =
          open == std::string_view::npos ? "s" : cell.substr(open + 1, cell.find(']') - open - 1);
      if (unit != "s" && unit != "ms") fail("time in '" + std::string(unit) + "'; expected t[s]");
      column.unit.factor = unit == "ms" ? 1e-3 : 1.0;
      return column;
    }
    column.role = role_of(name);
    if (!column.role) {
      table_.notes.push_back(name_ + ":" + std::to_string(line_) + ": column '" +
                             std::string(cell) + "' names no role, ignored");
      return column;
    }
    if (!table_[*column.role].empty() || seen_[static_cast<std::size_t>(*column.role)]) {
      fail("role '" + std::string(name) + "' stands twice");
    }
    seen_[static_cast<std::size_t>(*column.role)] = true;
    const can::Dimension wanted = daemon::role_dimension(*column.role);
    const std::string_view unit_text = open == std::string_view::npos
                                           ? std::string_view{}
                                           : cell.substr(open + 1, cell.rfind(']') - open - 1);
    // "[1]" is what replay --signals-out writes for a share.
    const bool share = wanted == can::Dimension::kShare && unit_text == can::si_unit_text(wanted);
    const std::optional<can::Unit> unit = share               ? can::Unit{wanted}
                                          : unit_text.empty() ? std::nullopt
                                                              : can::parse_unit(unit_text);
    if (wanted == can::Dimension::kNone) return column;
    if (!unit || unit->dimension != wanted) {
      fail("column '" + std::string(cell) + "': expected a unit of " +
           std::string(can::dimension_name(wanted)) + ", e.g. " + std::string(name) + "[" +
           std::string(can::si_unit_text(wanted)) + "]");
    }
    column.unit = *unit;
    return column;
  }

  void read_row() {
    if (const char* const wrong = width_.wrong(cells_)) {
      if (first_wrong_ == nullptr) {
        first_wrong_ = wrong;
        first_wrong_row_ = line_;
      }
      if (cells_.size() <= columns_.size()) {
        count(short_);
      } else {
        count(long_);
      }
      return;
    }
    values_.assign(columns_.size(), std::nullopt);
    double t_s = std::nan("");
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      double value = 0.0;
      switch (parse_number(cells_[i], value)) {
        case Cell::kBad:
          has_decimal_comma_ |= separator_ != ',' && cells_[i].find(',') != std::string_view::npos;
          count(bad_);
          return;
        case Cell::kNotFinite:
          if (columns_[i].role) count(not_finite_);
          break;
        case Cell::kMissing:
          break;
        case Cell::kNumber:
          if (columns_[i].time) {
            t_s = value * columns_[i].unit.factor;
          } else {
            values_[i] = value * columns_[i].unit.factor + columns_[i].unit.offset;
          }
      }
    }
    if (!(std::abs(t_s) <= kLatest_s)) {
      count(bad_);
      return;
    }
    // A clock that is set back begins a new stretch too; a few lines in disorder do not, nor a
    // garbled time.
    if (rows_ > 0 && t_s + shift_s_ < last_t_s_ - kSetBack_s && !goes_on()) {
      shift_s_ = last_t_s_ + kSetBack_s - t_s;
      count(set_back_);
    }
    t_s += shift_s_;
    if (rows_ > 0 && t_s <= last_t_s_) {
      count(backward_);
      return;
    }
    last_t_s_ = t_s;
    ++rows_;
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      const auto& role = columns_[i].role;
      const auto& value = values_[i];
      if (!role || !value) continue;
      Channel& channel = table_[*role];
      channel.t_s.push_back(t_s);
      channel.value.push_back(*value);
    }
  }
  // The time, in one of the next few lines, from where it was before this one.
  bool goes_on() {
    std::string_view rest = rest_;
    for (std::size_t looked = 0; looked < can::kStrayStamps && !rest.empty();) {
      const std::string_view line = next_line(rest);
      if (!is_row(line)) continue;
      ++looked;
      can::split_row(line, separator_, cells_);
      double value = 0.0;
      if (width_.wrong(cells_) != nullptr || parse_number(cells_[time_], value) != Cell::kNumber) {
        continue;
      }
      if (value * columns_[time_].unit.factor + shift_s_ > last_t_s_) return true;
    }
    return false;
  }
  // What was left out of one kind.
  struct Tally {
    std::size_t count = 0, first_line = 0;
  };
  void count(Tally& tally) const {
    if (tally.count++ == 0) tally.first_line = line_;
  }

  std::string_view rest_;
  std::string name_;
  SignalTable table_;
  std::size_t line_ = 0;
  char separator_ = ',';
  std::vector<Column> columns_;
  can::Cells cells_;
  can::RowWidth width_;
  std::vector<std::optional<double>> values_;
  std::array<bool, daemon::kRoleCount> seen_{};
  std::size_t time_ = 0;  // its column
  static constexpr double kSetBack_s = 3.0;
  static constexpr double kLatest_s = 1e11;  // beyond, seconds have no microseconds left
  std::size_t rows_ = 0;
  Tally bad_, long_, short_, not_finite_, set_back_, backward_;
  bool has_decimal_comma_ = false;
  const char* first_wrong_ = nullptr;  // what is wrong with the first line of another width
  std::size_t first_wrong_row_ = 0;
  double last_t_s_ = 0.0, shift_s_ = 0.0;
};

}  // namespace

double median_period_s(const Channel& channel) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < channel.t_s.size(); ++i) {
    steps.push_back(channel.t_s[i] - channel.t_s[i - 1]);
  }
  return steps.empty() ? std::numeric_limits<double>::quiet_NaN() : estimator::median(steps);
}

void widen(Reaches& reaches, const SignalTable& table) {
  for (std::size_t role = 0; role < reaches.size(); ++role) {
    for (const double value : table.channels[role].value) {
      reaches[role].lowest = std::min(reaches[role].lowest, value);
      reaches[role].highest = std::max(reaches[role].highest, value);
    }
  }
}

void close_gaps(SignalTable& table) {
  // At most so much, however seldom rows come: what looks at the course of the signals takes time
  // by its length.
  constexpr double kPause_s = 5.0, kPausePeriods = 20.0, kPauseMost_s = 20.0;
  constexpr double kRounding_s = 1e-4;  // of the latest stamps: a pause that was closed is none
  constexpr std::size_t kNotesMost = 5;
  std::vector<double> all;
  for (const Channel& channel : table.channels) {
    if (channel.empty()) continue;
    std::vector<double> both;
    both.reserve(all.size() + channel.t_s.size());
    std::set_union(all.begin(), all.end(), channel.t_s.begin(), channel.t_s.end(),
                   std::back_inserter(both));
    all = std::move(both);
  }
  if (all.size() < 3) return;
  std::vector<double> steps;
  steps.reserve(all.size() - 1);
  for (std::size_t i = 1; i < all.size(); ++i) steps.push_back(all[i] - all[i - 1]);
  std::vector<double> sorted = steps;
  const double pause_s =
      std::clamp(kPausePeriods * estimator::median(sorted), kPause_s, kPauseMost_s);
  struct Shifted {
    double begin_s, shift_s;
  };
  std::vector<Shifted> stretches{{all.front(), 0.0}};
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (steps[i] <= pause_s + kRounding_s) continue;
    stretches.push_back({all[i + 1], stretches.back().shift_s + (steps[i] - pause_s)});
    if (stretches.size() > kNotesMost + 1) continue;
    std::array<char, 120> text;
    std::snprintf(text.data(), text.size(),
                  ": %.6g s without a sample before t = %.9g s: a new stretch begins", steps[i],
                  all[i + 1]);
    table.notes.push_back(table.name + text.data());
  }
  if (stretches.size() > kNotesMost + 1) {
    table.notes.push_back(table.name + ": " + std::to_string(stretches.size() - 1) +
                          " such pauses in all");
  }
  for (Channel& channel : table.channels) {
    std::size_t stretch = 0;
    for (double& t_s : channel.t_s) {
      while (stretch + 1 < stretches.size() && t_s >= stretches[stretch + 1].begin_s) ++stretch;
      t_s -= stretches[stretch].shift_s;
    }
  }
}

SignalTable parse_csv(std::string_view text, const std::string& name) {
  SignalTable table = CsvParser(text, name).parse();
  close_gaps(table);
  return table;
}

SignalTable read_csv(const std::string& path) {
  // A signal that asks for an end may fall into the wait for a pipe: what was begun is read.
  std::FILE* opened = nullptr;
  do {
    errno = 0;
    opened = std::fopen(path.c_str(), "rb");
  } while (opened == nullptr && errno == EINTR);
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(opened, &std::fclose);
  if (!file) throw TableError{true, path + ": cannot be opened"};
  std::string text;
  std::array<char, 1 << 16> buffer;
  for (;;) {
    errno = 0;
    const std::size_t got = std::fread(buffer.data(), 1, buffer.size(), file.get());
    text.append(buffer.data(), got);
    if (std::ferror(file.get()) && errno == EINTR) {
      std::clearerr(file.get());
    } else if (got == 0) {
      break;
    }
  }
  if (std::ferror(file.get())) throw TableError{true, path + ": cannot be read"};
  return parse_csv(text, path);
}

}  // namespace beltgrip::diagnose
