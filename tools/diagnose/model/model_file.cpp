#include "tools/diagnose/model/model_file.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "tools/diagnose/model/effects/effect.h"
#include "tools/diagnose/model/variator_model.h"

namespace beltgrip::diagnose {
namespace {

// Name in the file and conversion of a nuisance.
struct Named {
  std::string name;
  double value;
};
Named to_file(int index, double value) {
  switch (index) {
    case kLnMuMax:
      return {"mu_max", std::exp(value)};
    case kLnPeakSlipOverdrive:
      return {"peak_slip_overdrive_percent", 100.0 * std::exp(value)};
    case kLnPeakSlipLow:
      return {"peak_slip_low_percent", 100.0 * std::exp(value)};
    case kLnRatioOverdrive:
      return {"ratio_overdrive_relative", std::expm1(value)};
    case kLnRatioLow:
      return {"ratio_low_relative", std::expm1(value)};
    default:
      return {std::string(default_nuisances()[static_cast<std::size_t>(index)].name), value};
  }
}

// No part of the machine that a model file describes.
bool is_beside_file(int index) {
  return index == kSecondaryTorqueGain || index == kPressureBias_Pa ||
         index == kCentrifugalOff_N_s2 || index == kDeformationLost || index == kPlay_N ||
         index == kPlayFrom;
}

}  // namespace

ModelFile nominal_model(const estimator::VariatorParameters& variator) {
  ModelFile out;
  out.variator = variator;
  const NuisanceTable table = default_nuisances();
  for (int i = 0; i < kNuisanceCount; ++i) {
    if (is_beside_file(i)) continue;
    const Named named = to_file(i, table[static_cast<std::size_t>(i)].nominal);
    (daemon::is_friction_key(named.name) ? out.friction : out.driveline)[named.name] = named.value;
  }
  return out;
}

NuisanceTable nuisances_of(const ModelFile& model) {
  NuisanceTable table = default_nuisances();
  for (int i = 0; i < kNuisanceCount; ++i) {
    if (is_beside_file(i)) continue;
    auto& row = table[static_cast<std::size_t>(i)];
    const std::string name = to_file(i, row.nominal).name;
    const auto& section = daemon::is_friction_key(name) ? model.friction : model.driveline;
    const auto found = section.find(name);
    if (found == section.end()) continue;
    switch (i) {
      case kLnMuMax:
        row.nominal = std::log(found->second);
        break;
      case kLnPeakSlipOverdrive:
      case kLnPeakSlipLow:
        row.nominal = std::log(0.01 * found->second);
        break;
      case kLnRatioOverdrive:
      case kLnRatioLow:
        row.nominal = std::log1p(found->second);
        break;
      default:
        row.nominal = found->second;
    }
  }
  return table;
}

void store_machine(const Eigen::VectorXd& nuisance, ModelFile& model) {
  for (int i = 0; i < kNuisanceCount; ++i) {
    if (is_beside_file(i)) continue;
    const Named named = to_file(i, nuisance[i]);
    (daemon::is_friction_key(named.name) ? model.friction : model.driveline)[named.name] =
        named.value;
  }
  // By what the maker states no friction that is fitted beside it would be right.
  model.variator.secondary_centrifugal_N_s2 += nuisance[kCentrifugalOff_N_s2];
}

Eigen::VectorXd slot_values(const ModelFile& model, const std::vector<Slot>& slots) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(slots.size()));
  for (std::size_t i = 0; i < slots.size(); ++i) {
    const Slot& slot = slots[i];
    const auto effect = model.effects.find(std::string(slot.row->id));
    if (effect == model.effects.end()) continue;
    const auto value = effect->second.parameters.find(std::string(slot.row->parameter));
    if (value == effect->second.parameters.end()) continue;
    const auto at = effect->second.parameters.find("at");
    const bool counted = slot.counts_experiments();
    if (counted && (at == effect->second.parameters.end() || at->second != slot.index)) continue;
    // A role that these data do not have: the slot without one.
    const bool exists = slot.row->id == "channel_skew" ||
                        std::any_of(slots.begin(), slots.end(), [&](const Slot& other) {
                          return other.row == slot.row && other.role == effect->second.role;
                        });
    if (slot.role != (exists ? effect->second.role : "")) continue;
    out[static_cast<Eigen::Index>(i)] = slot.from_contract(value->second, model.friction);
  }
  return out;
}

void store_effects(const std::vector<Slot>& slots, const Eigen::VectorXd& value,
                   const Eigen::VectorXd& nuisance, ModelFile& model) {
  for (std::size_t i = 0; i < slots.size(); ++i) {
    const double v = value[static_cast<Eigen::Index>(i)];
    if (v == 0.0) continue;
    const Slot& slot = slots[i];
    ModelEffect& effect = model.effects[std::string(slot.row->id)];
    effect.parameters[std::string(slot.row->parameter)] = slot.to_contract(v, nuisance);
    if (slot.counts_experiments()) effect.parameters["at"] = slot.index;
    if (!slot.role.empty()) effect.role = std::string(slot.role);
  }
}

}  // namespace beltgrip::diagnose
