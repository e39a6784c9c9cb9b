#include "tools/cli/role_evidence.h"

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <set>

#include "can_dbc/dbc/message_index.h"
#include "can_dbc/dbc/signal_codec.h"
#include "can_dbc/log/can_log.h"
#include "can_dbc/text/format.h"
#include "can_dbc/text/unit_text.h"
#include "tools/cli/failure.h"

namespace beltgrip::cli {

namespace {

// What a role can read in a car, in SI. Wide: what lies outside is another quantity or unit.
struct Plausible {
  can::Dimension dimension;
  double least, most;
};
constexpr std::array kPlausible{
    Plausible{can::Dimension::kAngularSpeed, -50.0, 2000.0},  // chosen: 19,000 1/min
    Plausible{can::Dimension::kPressure, -1e5, 1.5e7},        // chosen: twice a CVT's 7 MPa
    Plausible{can::Dimension::kTorque, -1000.0, 1500.0},      // chosen
    Plausible{can::Dimension::kTemperature, -50.0, 200.0},    // chosen: of a gearbox's oil
    Plausible{can::Dimension::kSpeed, -20.0, 110.0},          // chosen: 400 km/h
    Plausible{can::Dimension::kShare, -0.05, 1.3},            // chosen: pedals read beyond 100 %
};

// One candidate among the frames of its message.
struct Watched {
  const RoleCandidate* candidate;
  can::SignalCodec codec;
  std::optional<can::SignalCodec> selector;
  std::optional<std::uint64_t> raw;
};

bool is_selected(const Watched& watched, std::span<const std::uint8_t> payload) {
  const auto& rule = watched.candidate->signal->multiplexed_by;
  if (!rule) return true;
  if (!watched.selector || !watched.selector->fits(payload.size())) return false;
  const std::uint64_t at = watched.selector->raw(payload);
  return std::any_of(rule->ranges.begin(), rule->ranges.end(),
                     [at](const auto& range) { return at >= range.first && at <= range.second; });
}

void take(Watched& watched, std::span<const std::uint8_t> payload, Evidence& evidence) {
  if (!watched.codec.fits(payload.size()) || !is_selected(watched, payload)) return;
  const std::uint64_t raw = watched.codec.raw(payload);
  // "Not available" is no value.
  if (watched.candidate->signal->length > 1 && watched.codec.is_all_ones(raw)) return;
  const double value = watched.codec.physical(raw);
  if (watched.raw && *watched.raw != raw) ++evidence.changes;
  watched.raw = raw;
  evidence.least = evidence.values == 0 ? value : std::min(evidence.least, value);
  evidence.most = evidence.values == 0 ? value : std::max(evidence.most, value);
  ++evidence.values;
  evidence.nonzero += raw != 0;
}

std::vector<Watched> watched_of(const std::vector<RoleCandidate>& candidates) {
  std::vector<Watched> all;
  std::set<const can::SignalDef*> known;
  for (const RoleCandidate& each : candidates) {
    if (!known.insert(each.signal).second) continue;
    Watched watched{&each, can::SignalCodec(*each.signal), std::nullopt, std::nullopt};
    if (const auto& rule = each.signal->multiplexed_by) {
      const can::SignalDef* selector = each.message->find_signal(rule->selector);
      if (selector != nullptr) watched.selector.emplace(*selector);
    }
    all.push_back(watched);
  }
  return all;
}

void read_log(const std::string& path, std::vector<Watched>& all, EvidenceOf& evidence) {
  std::unique_ptr<can::LogReader> reader;
  try {
    reader = can::LogReader::open(path);
  } catch (const can::LogOpenError& error) {
    throw Failure{kNoInput, error.text};
  }
  can::LogRecord record;
  while (reader->next(record)) {
    if (record.frame.error || record.frame.remote) continue;
    for (Watched& each : all) {
      const can::MessageDef& message = *each.candidate->message;
      if (!can::is_of_message(record.frame.id, message.id, message.j1939)) continue;
      take(each, record.frame.payload(), evidence[each.candidate->signal]);
    }
  }
  if (reader->stats().frames == 0) {
    throw Failure{kBadInput, path + ": found no readable frame, expected a log of the car"};
  }
}

// Of a value of the signal in SI, where its unit is known.
std::optional<double> in_si(const RoleCandidate& candidate, double value) {
  const auto unit = can::parse_unit(candidate.signal->unit);
  if (!unit) return std::nullopt;
  return unit->factor * value + unit->offset;
}

bool is_plausible(daemon::Role role, const RoleCandidate& candidate, const Evidence& evidence) {
  const auto least = in_si(candidate, evidence.least), most = in_si(candidate, evidence.most);
  if (!least || !most) return true;
  return std::all_of(kPlausible.begin(), kPlausible.end(), [&](const Plausible& range) {
    return range.dimension != daemon::role_dimension(role) ||
           (*least >= range.least && *most <= range.most);
  });
}

}  // namespace

EvidenceOf read_evidence(const std::vector<std::string>& logs,
                         const std::vector<RoleCandidate>& candidates) {
  EvidenceOf evidence;
  for (const RoleCandidate& each : candidates) evidence[each.signal] = {};
  std::vector<Watched> all = watched_of(candidates);
  for (const std::string& log : logs) read_log(log, all, evidence);
  return evidence;
}

Judgement judge(daemon::Role role, const RoleCandidate& candidate, const Evidence& evidence) {
  if (evidence.values == 0) return {false, "not in the log"};
  const std::string& unit = candidate.signal->unit;
  if (daemon::role_dimension(role) == can::Dimension::kNone) {
    return {true, format("in the log not 0 for %.0f %%, %llu changes",
                         100.0 * static_cast<double>(evidence.nonzero) /
                             static_cast<double>(evidence.values),
                         static_cast<unsigned long long>(evidence.changes))};
  }
  const std::string range =
      format("%.4g .. %.4g ", evidence.least, evidence.most) + unit + " in the log";
  if (evidence.changes == 0) return {false, "stands still at " + range};
  if (!is_plausible(role, candidate, evidence)) return {false, range + ", which cannot be"};
  return {true, range};
}

void order_by(const EvidenceOf& evidence, daemon::Role role,
              std::vector<RoleCandidate>& candidates) {
  std::stable_partition(candidates.begin(), candidates.end(), [&](const RoleCandidate& each) {
    const auto found = evidence.find(each.signal);
    return found != evidence.end() && judge(role, each, found->second).lives;
  });
}

}  // namespace beltgrip::cli
