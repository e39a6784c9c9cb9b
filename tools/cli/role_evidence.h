// What logs say of signals that may carry a role: a candidate whose message never comes, or whose
// values stand still or cannot be, gives way to one that lives. Tools only.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tools/cli/role_guess.h"

namespace beltgrip::cli {

struct Evidence {
  std::uint64_t values = 0;
  std::uint64_t changes = 0;       // of its raw value
  double least = 0.0, most = 0.0;  // in the unit of the DBC
  std::uint64_t nonzero = 0;
};
using EvidenceOf = std::map<const can::SignalDef*, Evidence>;

// Of every candidate, over all logs. Throws Failure: 66 a log is missing, 65 it has no frame.
EvidenceOf read_evidence(const std::vector<std::string>& logs,
                         const std::vector<RoleCandidate>& candidates);

// What speaks for or against it, in words; and whether it can carry the role at all.
struct Judgement {
  bool lives = false;
  std::string text;
};
Judgement judge(daemon::Role role, const RoleCandidate& candidate, const Evidence& evidence);

// Those that live first, in their order; the others follow.
void order_by(const EvidenceOf& evidence, daemon::Role role,
              std::vector<RoleCandidate>& candidates);

}  // namespace beltgrip::cli
