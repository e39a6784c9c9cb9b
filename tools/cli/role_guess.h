// Which signals of a DBC may carry a role: by dimension of the unit and by the words in the names.
// A guess for a person to check, no more. Tools only.
#pragma once

#include <string>
#include <vector>

#include "can_dbc/dbc_model.h"
#include "daemon/core/config.h"

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

// "N_PrimSpd2" -> n, prim, spd.
std::vector<std::string> words_of(const std::string& name);

}  // namespace beltgrip::cli
