// Which signals of a DBC may carry a role: by dimension of the unit and by the words in the names.
// A guess for a person to check, no more. Tools only.
#pragma once

#include <string>
#include <vector>

#include "can_dbc/dbc/model.h"
#include "daemon/core/config/options/config.h"

namespace beltgrip::cli {

struct RoleCandidate {
  const can::MessageDef* message = nullptr;
  const can::SignalDef* signal = nullptr;
  bool has_unit = false;  // of the right dimension; otherwise the DBC gives none
  int score = 0;
};

// Best first. Pointers into the databases.
std::vector<RoleCandidate> guess_role(daemon::Role role,
                                      const std::vector<can::Database>& databases);

// At which values a flag is 1.
struct TrueWhen {
  bool needed = false;  // 1 does not do: it has other values, or 1 is the name of something else
  std::string label;    // of the value table; empty: none tells
};
TrueWhen guess_true_when(daemon::Role role, const can::SignalDef& signal);

// "N_PrimSpd2" -> n, prim, spd.
std::vector<std::string> words_of(const std::string& name);

}  // namespace beltgrip::cli
