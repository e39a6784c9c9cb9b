// [learned.NAME] of a model file: a cause without a name. Start-up and tools only.
#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "daemon/core/config/toml/config_document.h"
#include "daemon/core/config/toml/config_errors.h"
#include "estimator/physics/learned_term.h"

namespace beltgrip::daemon {

// As in the file.
struct ModelLearned {
  std::string acts_on;                               // of estimator::kLearnedPoints
  std::vector<std::string> depends_on;               // one role of estimator::kLearnedRoles
  std::vector<double> knots, values;                 // as many; knots rise
  std::vector<double> covariance;                    // of the values, row by row; empty: not known
  std::map<std::string, std::array<double, 2>> box;  // by role; where it holds
  std::string law;                                   // in words; empty: none
};

// False when errors were added.
bool read_learned(const TomlNode& section, ModelLearned& into, ConfigErrors& errors);
std::string learned_text(const std::string& name, const ModelLearned& learned);

estimator::LearnedTerm term_of(const std::string& name, const ModelLearned& learned);

}  // namespace beltgrip::daemon
