// Measured signals as columns, one table per experiment, as they stand in the file: own time stamps
// per channel, SI, nothing filled in. Tools only.
#pragma once

#include <array>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/core/config/options/config.h"

namespace beltgrip::diagnose {

using daemon::Role;

struct Channel {
  std::vector<double> t_s;    // strictly increasing
  std::vector<double> value;  // SI; same length
  bool empty() const { return t_s.empty(); }
};

// Of the pauses between its samples; no number with fewer than two.
double median_period_s(const Channel& channel);

struct SignalTable {
  std::string name;  // the file, as given
  std::array<Channel, daemon::kRoleCount> channels;
  std::vector<std::string> notes;  // what was wrong with single lines or columns, one sentence each
  const Channel& operator[](Role role) const { return channels[static_cast<std::size_t>(role)]; }
  Channel& operator[](Role role) { return channels[static_cast<std::size_t>(role)]; }
};

// The lowest and the highest value that each channel reaches in some tables.
struct Reach {
  double lowest = std::numeric_limits<double>::infinity();
  double highest = -std::numeric_limits<double>::infinity();
};
using Reaches = std::array<Reach, daemon::kRoleCount>;
void widen(Reaches& reaches, const SignalTable& table);

struct TableError {
  bool missing_file = false;  // else: the content cannot be used at all
  std::string text;           // one line: file, line, what was found, what would be right
};

// Where no channel has a sample for long, a new stretch begins: its samples follow after a pause of
// five seconds, or twenty of the table's periods where that is more, so that memory and time follow
// the samples, never a clock that was set. Each is noted. Of a recording whose clock did not stop,
// only the pause is shorter.
void close_gaps(SignalTable& table);

// "t[s],primary_speed[rad/s],...": role and unit in each cell of the first line; comma, semicolon
// or tab; empty cells and NaN are missing values. Throws TableError.
SignalTable read_csv(const std::string& path);
SignalTable parse_csv(std::string_view text, const std::string& name);

}  // namespace beltgrip::diagnose
