// The model file: what the simulation believes of the machine, and the effects switched on. TOML:
// [variator] as in the configuration, [friction], [driveline], [effects.ID]. Start-up and tools
// only.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "estimator/parameters.h"
#include "tools/diagnose/effects/effect.h"

namespace beltgrip::diagnose {

struct ModelEffect {
  std::map<std::string, double> parameters;  // as in the contract, by name
  std::string role;                          // channel_skew
};

struct ModelFile {
  estimator::VariatorParameters variator;
  std::map<std::string, double> friction;   // nominal curve: names of [friction]
  std::map<std::string, double> driveline;  // losses, deformation: names of [driveline]
  std::map<std::string, ModelEffect> effects;
  std::vector<std::string> comments;  // written at the top, one line each; not read
};

struct ModelError {
  bool missing_file = false;
  std::string text;  // one line: file, line, key, found, expected
};

// Keys that the file leaves out keep the values of `base`. Throws ModelError.
ModelFile read_model(const std::string& path, const ModelFile& base);
ModelFile parse_model(const std::string& text, const std::string& name, const ModelFile& base);
std::string model_text(const ModelFile& model);

// The nominal machine without any file: [friction] and [driveline] with their defaults.
ModelFile nominal_model(const estimator::VariatorParameters& variator);

// The machine's constants of a model as nominal values of a fit, and back.
NuisanceTable nuisances_of(const ModelFile& model);
void store_machine(const Eigen::VectorXd& nuisance, ModelFile& model);
// Values of the slots that a model switches on; an effect that these data cannot carry is left out.
Eigen::VectorXd slot_values(const ModelFile& model, const std::vector<Slot>& slots);
// Adds the values of the slots to the model's effects.
void store_effects(const std::vector<Slot>& slots, const Eigen::VectorXd& value,
                   const Eigen::VectorXd& nuisance, ModelFile& model);

}  // namespace beltgrip::diagnose
