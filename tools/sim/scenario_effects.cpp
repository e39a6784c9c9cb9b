#include "tools/sim/scenario_effects.h"

namespace beltgrip::sim {

using estimator::effect_rows;
using estimator::EffectRow;

void ScenarioEffects::name(ScenarioReader& reader) {
  values_.assign(effect_rows().size(), 0.0);
  for (std::size_t i = 0; i < values_.size(); ++i) {
    const EffectRow& row = effect_rows()[i];
    const std::string effect = "effects." + std::string(row.id) + ".";
    reader.number(effect + std::string(row.parameter), values_[i], -1e9, 1e9,
                  std::string(row.equation));
    if (!row.roles.empty()) reader.text(effect + "role", roles_[std::string(row.id)]);
  }
}

void ScenarioEffects::put(ScenarioReader& reader, estimator::MachineEffects& machine) const {
  for (std::size_t i = 0; i < values_.size(); ++i) {
    const EffectRow& row = effect_rows()[i];
    if (values_[i] == 0.0) continue;
    const auto given = roles_.find(std::string(row.id));
    const std::string role = given == roles_.end() ? std::string() : given->second;
    if (!takes_role(row, role)) {
      std::string roles;
      for (const estimator::EffectRole& each : row.roles) {
        roles.append(roles.empty() ? "" : ", ").append(each.role);
      }
      std::string said = "found role = \"";
      said.append(role).append("\", expected one of ").append(roles);
      reader.contradiction("effects." + std::string(row.id) + "." + std::string(row.parameter),
                           said);
      continue;
    }
    if (double estimator::MachineEffects::*const value = value_of(row, role)) {
      machine.*value += values_[i];
    }
  }
}

}  // namespace beltgrip::sim
