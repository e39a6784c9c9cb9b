// Signals that all have a value at the same instants, written row by row: as a wide table in CSV,
// or as a measurement in MDF 4.1. Memory is flat in the number of rows. Tools only.
#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace beltgrip::signals {

struct Signal {
  std::string name;
  std::string unit;  // empty: none
};

class SignalWriter {
 public:
  virtual ~SignalWriter() = default;
  // Times increase. As many values as signals; one that is no number is a missing one.
  virtual void row(std::int64_t t_ns, std::span<const double> values) = 0;
  // Behind the last row.
  virtual void finish() = 0;
};

// "t[s],primary_speed[rad/s],...", missing values as empty cells. Each time as in the log.
std::unique_ptr<SignalWriter> make_csv_writer(std::FILE* out, const std::vector<Signal>& signals);

// `out` can be written at places: counts stand in front of the rows.
std::unique_ptr<SignalWriter> make_mf4_writer(std::FILE* out, const std::vector<Signal>& signals);

}  // namespace beltgrip::signals
