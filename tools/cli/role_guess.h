// Which signals of a DBC may carry a role: by unit, length, value table, and the words in names and
// comments (role_words.h). A guess for a person to check, no more. Tools only.
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
// Signals of the role's quantity that lack one word of its name, and that no other role claims by
// all of its words: for a person who knows the car. Best first.
std::vector<RoleCandidate> guess_in_part(daemon::Role role,
                                         const std::vector<can::Database>& databases);

// At which values a flag is 1.
struct TrueWhen {
  bool needed = false;  // 1 does not do: it has other values, or 1 is the name of something else
  std::string label;    // of the value table; empty: none tells
};
TrueWhen guess_true_when(daemon::Role role, const can::SignalDef& signal);

}  // namespace beltgrip::cli
