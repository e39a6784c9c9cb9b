#include "tools/table/table_log.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "can_dbc/dbc/signal_codec.h"
#include "can_dbc/log/text.h"
#include "can_dbc/text/table_row.h"
#include "tools/table/table_head.h"
#include "tools/table/table_text.h"

namespace beltgrip::table {

namespace {

constexpr double kNanoseconds = 1e9;
constexpr std::size_t kFirstBad = 10;

struct Cell {
  std::size_t column = 0;
  can::CanId id;
  can::SignalCodec codec;
  can::SignalDef signal;
};

class TableLog final : public can::LogReader {
 public:
  TableLog(const std::string& path, Head head, const can::Database& columns, double rate_Hz)
      : lines_(path), head_(std::move(head)), rate_Hz_(rate_Hz) {
    for (std::size_t i = 0; i < head_.columns.size(); ++i) {
      const can::MessageDef* message = columns.find_message(head_.columns[i].name);
      if (message == nullptr || head_.time == i) continue;
      const bool again = std::any_of(cells_.begin(), cells_.end(), [message](const Cell& each) {
        return each.id == message->id;  // the first column of a name counts
      });
      if (again) continue;
      const can::SignalDef& signal = message->signals.front();
      cells_.push_back({i, message->id, can::SignalCodec(signal), signal});
    }
  }

  bool next(can::LogRecord& record) override {
    for (;;) {
      while (next_ < cells_.size()) {
        const Cell& cell = cells_[next_++];
        const std::optional<double> value = value_of(cell);
        if (!value) continue;
        record = {};
        record.t_ns = t_ns_;
        record.interface = "table";
        record.frame.id = cell.id;
        record.frame.length = 8;
        cell.codec.encode({record.frame.data.data(), record.frame.length}, *value);
        ++stats_.frames;
        return true;
      }
      if (!next_row()) return false;
    }
  }
  const can::LogStats& stats() const override { return stats_; }

 private:
  bool next_row() {
    while (const auto line = lines_.next()) {
      ++stats_.lines;
      if (lines_.number() < head_.first_row) continue;
      can::split_row(*line, head_.separator, row_);
      const std::uint64_t number = row_number_++;  // the time of a bad row passes too
      if (const char* const wrong = head_.width.wrong(row_)) {
        count_bad(wrong);
        continue;
      }
      const std::optional<std::int64_t> t_ns = time_of_row(number);
      if (!t_ns) {
        count_bad("unreadable time");
        continue;
      }
      t_ns_ = *t_ns;
      next_ = 0;
      return true;
    }
    return false;
  }

  void count_bad(const char* reason) {
    ++stats_.lines_bad;
    if (stats_.first_bad.size() >= kFirstBad) return;
    stats_.first_bad.push_back({.line = lines_.number(), .reason = reason});
  }

  std::optional<std::int64_t> time_of_row(std::uint64_t number) const {
    if (!head_.time) {
      return static_cast<std::int64_t>(
          std::llround(kNanoseconds * static_cast<double>(number) / rate_Hz_));
    }
    const std::string_view cell = row_[*head_.time];
    auto t_ns = can::log_text::time_ns(cell, head_.time_unit_ns);
    if (!t_ns) t_ns = can::log_text::date_ns(cell);
    if (!t_ns) t_ns = can::log_text::clock_ns(cell);
    return t_ns;
  }

  std::optional<double> value_of(const Cell& cell) const {
    if (is_missing(row_[cell.column])) return {};
    const std::string_view text = row_[cell.column];
    // Of a DBC's value table the numbers stand in the cells.
    if (const auto number = number_of(text, head_.separator)) return number;
    for (const auto& [value, label] : cell.signal.values) {
      if (label == text) return static_cast<double>(value);
    }
    return {};
  }

  Lines lines_;
  Head head_;
  double rate_Hz_;
  std::vector<Cell> cells_;
  can::Cells row_;
  std::size_t next_ = std::numeric_limits<std::size_t>::max();  // cell of this row
  std::uint64_t row_number_ = 0;
  std::int64_t t_ns_ = 0;
  can::LogStats stats_;
};

}  // namespace

std::unique_ptr<can::LogReader> open(const std::string& path, const can::Database& columns,
                                     double rate_Hz) {
  std::optional<Head> head = read_head(path);
  if (!head) throw can::LogOpenError{path + ": is no table of signals"};
  if (!head->time && !(rate_Hz > 0.0)) {
    throw can::LogOpenError{path + ": a table of signals without a time column"};
  }
  return std::make_unique<TableLog>(path, *std::move(head), columns, rate_Hz);
}

}  // namespace beltgrip::table
