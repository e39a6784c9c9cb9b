// The keys of scenario files as tables, one per section: name, place, bounds, and the physical
// reason that a wrong value is answered with. What a rig and a car have alike stands here once.
// Tools only.
#pragma once

#include <numbers>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "can_dbc/dbc/model.h"
#include "tools/sim/scenario_reader.h"
#include "tools/sim/world.h"

namespace beltgrip::sim {

enum class KeyOf { kBoth, kRig, kVehicle };

template <typename Section>
struct NumberKey {
  const char* name;
  double Section::*field;
  double minimum, maximum;  // in the file
  const char* reason;
  double factor = 1.0;  // value in the file -> SI
  KeyOf plant = KeyOf::kBoth;
};

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kKmh = 1.0 / 3.6;
constexpr double kPercent = 0.01;

constexpr const char* kPositiveInertia = "a rotating mass has a positive inertia";
constexpr const char* kNoise = "a standard deviation is not negative";
constexpr const char* kLoss = "losses brake";
constexpr const char* kDuration = "a duration";

constexpr bool has(Plant plant, KeyOf key) {
  return key == KeyOf::kBoth || (key == KeyOf::kRig) == (plant == Plant::kRig);
}

// prefix: "engine." of the section; empty within a row.
template <typename Section>
void name_numbers(ScenarioReader& reader, const std::string& prefix, Section& section,
                  std::span<const NumberKey<Section>> keys, Plant plant) {
  for (const NumberKey<Section>& key : keys) {
    if (!has(plant, key.plant)) continue;
    reader.number(prefix + key.name, section.*key.field, key.minimum, key.maximum, key.reason,
                  key.factor);
  }
}

template <typename Scenario>
struct ScenarioResult {
  Scenario scenario;
  std::vector<std::string> errors;  // empty: the scenario can run
};

// name, [run], [variator], [sensors], [[fault]].
void name_world(ScenarioReader& reader, Plant plant, World& world);
void name_curve(ScenarioReader& reader, const std::string& prefix, FrictionCurve& curve);
// place: a key or section that was read, where a contradiction is found.
void check_curve(ScenarioReader& reader, const std::string& place, const FrictionCurve& curve);

// What no key can tell alone: the belt fits around pulleys with these ratios, named by their keys;
// each fault acts on something that is there. False where the geometry is wrong.
bool check_geometry(ScenarioReader& reader, const VariatorParameters& variator,
                    const std::vector<std::pair<std::string, double>>& ratios);
void check_faults(ScenarioReader& reader, Plant plant, const World& world,
                  const can::Database& dbc);

}  // namespace beltgrip::sim
