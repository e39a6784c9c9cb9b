// The history of a belt as a daemon keeps it, read and judged: what its experiments say together.
// Changes nothing, while the daemon runs or not. Tools only.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/core/observe/carried_record.h"
#include "daemon/io/history_db.h"
#include "estimator/belt/belt_history.h"

namespace beltgrip::cli {

// Where the service keeps it.
inline constexpr const char* kHistoryFolder = "/var/lib/beltgrip";

struct HistoryGroup {
  estimator::Direction direction;
  estimator::EndStop end_stop;
  estimator::FusedFriction fused;
  // The last five against those before; where friction has fallen, what is after its fall.
  estimator::WearTest wear;
  const daemon::HistoryRow* since = nullptr;  // the first after it; null where it has not fallen
};

struct History {
  std::string path;
  std::vector<daemon::HistoryRow> rows;
  std::int64_t damaged = 0;
  std::string fingerprint;           // of the last row: its configuration is the one that counts
  std::size_t comparable = 0;        // rows under it
  std::vector<HistoryGroup> groups;  // that hold a value
  daemon::CarriedBounds carried{};   // under it
};

// file: history.db or its folder; empty: as the configuration says, and where there is none the
// service's. Failure: 66 there is none, 65 it cannot be used, 64 there are several.
History read_history(const std::string& file, const std::string& config);

std::string utc(double time_s);
std::string notes_text(std::uint32_t notes, const char* separator);
// What the values of one group say together, in lines.
std::string fused_text(const HistoryGroup& group);
// What was carried without slip, a line each.
std::string carried_lines(const History& history);

}  // namespace beltgrip::cli
