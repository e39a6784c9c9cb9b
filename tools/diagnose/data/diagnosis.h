// The result of a diagnosis: one plain value, from which text, JSON, model file and report are
// made.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace beltgrip::diagnose {

struct Interval {
  double value = 0.0, low = 0.0, high = 0.0;  // 95 %
};

struct BeforeAfter {
  double before = 0.0, after = 0.0;
  double low = 0.0, high = 0.0;  // 95 % of before - after
};

struct Finding {
  std::string effect;
  std::map<std::string, Interval> parameters;
  std::map<std::string, double> fixed;  // what is counted, not estimated: wear's "at"
  std::string from_file;                // the same in words: the first file that has it
  std::string role;                     // channel_skew
  double probability = 0.0;
  // Share of the fits without one experiment in which it is there with 95 %; where fitted at all.
  std::optional<double> stability;
  std::vector<std::string> aliases;
  std::string separate_by;
  std::map<std::string, BeforeAfter> gain;
  std::string equation, acts_on;
};

// What is left unexplained looks like: a function of something recorded; a line in the spectrum; a
// difference between experiments that follows nothing recorded; a slow course within them.
enum class MisfitKind { kFunction, kLine, kBetweenRuns, kSlow };

struct Unexplained {
  std::string acts_on;
  std::vector<std::string> depends_on;
  double share = 0.0;
  MisfitKind kind = MisfitKind::kFunction;
  std::optional<double> frequency_Hz = std::nullopt;  // of a line
  bool is_belt = false;                               // a line at the belt's passage
};

// A cause without a name, as learned: a function of one recorded variable.
struct LearnedFinding {
  std::string name;  // in the model file
  std::string acts_on;
  std::vector<std::string> depends_on;  // roles
  std::string law;                      // in words; empty: none stands alone
  std::vector<std::string> laws;        // that these data cannot tell apart
  std::vector<std::string> aliases;     // "acts_on over role", that these data cannot tell from it
  int levels = 0;                       // of the variable
  std::map<std::string, BeforeAfter> gain;  // on experiments that were left out of the fit
  // The same, of the metric named, with all experiments at its level of the variable left out.
  std::string metric;
  std::optional<BeforeAfter> at_left_out_values;
  std::map<std::string, std::array<double, 2>> box;  // by role
  std::vector<double> knots, values, covariance;     // of the values, row by row
};

// An experiment to do: in words, and as a scenario that the simulation runs.
struct Recipe {
  std::string text;
  std::string scenario;  // TOML
};

struct NotIdentifiable {
  std::string effect;
  std::map<std::string, double> smallest_detectable;
  std::string reason;
};

struct BaselineSignal {
  double rmse = 0.0, noise_floor = 0.0, unexplained_share = 0.0;
  std::map<std::string, double> tests;
};

// A signal that the simulation predicts when it is run forward.
struct SimulatedSignal {
  double rmse = 0.0, noise_floor = 0.0;  // of the nominal machine
  std::optional<BeforeAfter> left_out;   // on experiments that were not used for the fit
};

struct MuMaxError {
  double before = 0.0, after = 0.0, low = 0.0, high = 0.0;
};

// What the estimator makes of an experiment.
struct Measured {
  double mu_max = 0.0;
  double slip_stop_percent = 0.0;
  double min_clamp_force_N = 0.0;  // for the torque at its end
};
// The same experiment by an estimator that is told the model before and after; nothing where it
// gives no value.
struct Rerun {
  std::string log;
  double start_s = 0.0;
  std::optional<Measured> before, after;
};

// kNone: too little was seen to say anything; null in JSON.
enum class Verdict { kNone, kNothingWrong, kExplained, kUnexplained };

struct Diagnosis {
  Verdict verdict = Verdict::kNone;
  std::map<std::string, BaselineSignal> baseline;
  // The tests of what the model and all findings leave: value and the limit above which it fails.
  struct Left {
    double value = 0.0, limit = 0.0;
  };
  std::map<std::string, Left> left;
  std::map<std::string, SimulatedSignal> simulation;
  std::vector<Finding> findings;
  std::vector<LearnedFinding> learned;
  // Share of the misfit beyond noise and scatter that goes with all of these in the model.
  std::optional<double> explained_share;
  std::optional<Unexplained> unexplained;
  std::vector<NotIdentifiable> not_identifiable;
  std::map<std::string, BeforeAfter> held_out;
  std::optional<MuMaxError> mu_max;
  std::vector<Rerun> reruns;  // with findings only
  std::optional<Recipe> next_experiment;
  std::vector<std::string> notes;
  bool scatter_from_replicates = false;     // else from what rigs usually scatter by
  std::map<std::string, Interval> machine;  // constants of the nominal machine, as fitted
  int experiments = 0;
  int samples = 0;
  bool complete = true;  // false: stopped on the way
};

}  // namespace beltgrip::diagnose
