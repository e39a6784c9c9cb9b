// The blind generator's recording as diagnose takes it.
#pragma once

#include <string>
#include <vector>

#include "tests/statistics/blind/generator.h"
#include "tools/diagnose/data/experiment_data.h"
#include "tools/diagnose/infer/engine.h"
#include "tools/diagnose/run/diagnose.h"

namespace beltgrip::diagnose {

// Told the inertia that the generator's machine has, and nothing else of it.
inline Campaign campaign_of(const blind::Trial& trial, const Accuracies& accuracies = {}) {
  estimator::VariatorParameters variator;
  variator.primary_inertia_kg_m2 = trial.machine.primary_inertia_kg_m2;
  std::vector<ExperimentData> runs;
  for (const std::string& text : blind::record(trial).csv) {
    runs.push_back(prepare(parse_csv(text, "run.csv"), variator));
  }
  return make_campaign(std::move(runs), nominal_model(variator), accuracies);
}

// The same as the program asks.
inline Request request_of(const blind::Trial& trial) {
  Request request;
  estimator::VariatorParameters variator;
  variator.primary_inertia_kg_m2 = trial.machine.primary_inertia_kg_m2;
  request.model = nominal_model(variator);
  for (const std::string& text : blind::record(trial).csv) {
    request.experiments.push_back(parse_csv(text, "run.csv"));
  }
  return request;
}

}  // namespace beltgrip::diagnose
