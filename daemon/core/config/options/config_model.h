// The model file: what the simulation believes of the machine, and the effects switched on. TOML:
// [variator] as in the configuration, [friction], [driveline], [effects.ID], [learned.NAME].
// Start-up and tools only.
#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/core/config/options/config_learned.h"
#include "daemon/core/config/options/option.h"
#include "daemon/core/config/toml/config_text.h"
#include "estimator/physics/machine_effects.h"
#include "estimator/physics/parameters.h"

namespace beltgrip::daemon {

struct ModelEffect {
  std::map<std::string, double> parameters;  // as in the file, by name
  std::string role;                          // channel_skew; hydraulic_lag of the command
};

struct ModelFile {
  estimator::VariatorParameters variator;
  std::map<std::string, double> friction;   // what the file gives of [friction]
  std::map<std::string, double> driveline;  // and of [driveline]
  std::map<std::string, ModelEffect> effects;
  std::map<std::string, ModelLearned> learned;
  std::vector<std::string> variator_keys;  // what the file gives of [variator]
  std::vector<std::string> comments;       // written at the top, one line each; not read
};

struct ModelError {
  bool missing_file = false;
  std::string text;  // one line: file, line, key, found, expected
};

// The keys of [friction] and [driveline]; those of [effects.ID] are in the table of effects.
std::span<const OptionRow> friction_options();
std::span<const OptionRow> driveline_options();
bool is_friction_key(std::string_view name);
bool is_driveline_key(std::string_view name);

// Keys that the file leaves out keep the values of `base`. Throws ModelError.
ModelFile read_model(const std::string& path, const ModelFile& base,
                     FileKind kind = FileKind::kAny);
ModelFile parse_model(const std::string& text, const std::string& name, const ModelFile& base);
std::string model_text(const ModelFile& model);

// What was learned without a name of its own among the effects.
std::vector<estimator::LearnedTerm> learned_terms(const ModelFile& model);

// The effects as plain values.
estimator::MachineEffects machine_effects(const ModelFile& model);
// The same with what [driveline] gives of losses and geometry on top: all that separates what is
// measured from what the belt feels.
estimator::MachineEffects whole_machine(const ModelFile& model);

}  // namespace beltgrip::daemon
