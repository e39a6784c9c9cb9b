// What the report draws: what was found, measured and simulated signals, residuals over time and
// over the variables they may depend on, friction curves, order spectra of the speeds.
#pragma once

#include <vector>

#include "tools/diagnose/data/diagnosis.h"
#include "tools/diagnose/data/signal_table.h"
#include "tools/diagnose/infer/engine.h"
#include "tools/report/html_page.h"

namespace beltgrip::diagnose {

struct Plots {
  std::vector<report::Chart> findings, signals, over_time, over_variables, friction, orders;
  std::vector<std::vector<report::Series>> learned;  // points_of_learned
};

Plots make_plots(const Campaign& campaign, const ModelState& nominal, const ModelState& extended,
                 const std::vector<SignalTable>& tables, const Diagnosis& found);

}  // namespace beltgrip::diagnose
