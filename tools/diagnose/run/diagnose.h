// The whole diagnosis: tables in, one result out.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "estimator/physics/assumed_constants.h"
#include "tools/diagnose/data/diagnosis.h"
#include "tools/diagnose/data/signal_table.h"
#include "tools/diagnose/model/model_file.h"
#include "tools/diagnose/report/plots.h"

namespace beltgrip::diagnose {

struct Request {
  std::vector<SignalTable> experiments;  // in the order in which they were made
  std::vector<SignalTable> held_out;     // empty: experiments are held out in turn
  ModelFile model;
  bool is_model_given = false;                   // else it is the usual machine
  Accuracies accuracies{};                       // what is known of the sensors'
  std::vector<daemon::AssumedAccuracy> assumed;  // of these, what nobody told
  estimator::ConstantSet assumed_constants;      // of the machine's, the same
  bool with_plots = false;
  int jobs = 1;                // threads; the answer is the same for every number
  std::function<bool()> stop;  // true: end with what is known
  std::function<void(double share, const std::string& what)> progress;
};

struct Answer {
  Diagnosis diagnosis;
  ModelFile extended;  // the model with what was found
  Plots plots;
  std::string impossible;  // why nothing can be analysed; empty: it can
};

Answer diagnose(Request request);

}  // namespace beltgrip::diagnose
