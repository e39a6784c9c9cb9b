// What the extended model is worth: errors of the predicted signals on experiments that were not
// used for the fit, before and after.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tools/diagnose/data/diagnosis.h"
#include "tools/diagnose/infer/engine.h"

namespace beltgrip::diagnose {

// Errors of one experiment under a state: secondary_speed where the torque decides the slip (below
// the peak), the torque where the slip decides it, secondary_torque and secondary_pressure from
// balance and command.
struct SignalErrors {
  struct Sum {
    double squares = 0.0;
    double count = 0.0;
  };
  std::map<std::string, Sum> signal;
  double ln_mu_sum = 0.0, ln_mu_count = 0.0;  // measured over modelled friction about the peak
};
SignalErrors signal_errors(const Campaign& campaign, int run, const ModelState& state);

// Noise of the same signals, from differences of neighbouring samples.
std::map<std::string, double> noise_floors(const Campaign& campaign, const ModelState& state);

// The same of the signals that the simulation predicts when it is run forward, each where both
// states' belts grip.
struct ForwardErrors {
  SignalErrors before, after;
};
ForwardErrors forward_errors(const Campaign& campaign, int run, const ModelState& before,
                             const ModelState& after);
// Errors of the nominal machine run forward, and their noise, from differences of neighbours.
std::map<std::string, SimulatedSignal> simulated_signals(const Campaign& campaign,
                                                         const ModelState& nominal);

// Beyond chance, by a tenth and beyond its noise.
bool is_clearly_worse(const BeforeAfter& change, double noise_floor);

struct Gain {
  std::map<std::string, BeforeAfter> signals;
  std::map<std::string, BeforeAfter> forward;
  std::optional<MuMaxError> mu_max;
  std::optional<Interval> density;  // of the log predictive density, all signals at once
  // One signal is predicted better, beyond chance and by more than a trifle; or clearly so, and all
  // at once beyond chance.
  bool better() const;
  // One signal is predicted clearly worse.
  bool worse(const std::map<std::string, double>& noise_floor) const;
};

// The machine as all experiments but one say it is, by one linear step from the fit to all.
struct LeftOut {
  std::vector<ModelState> states;  // per experiment left out
  std::vector<double> spread;      // per slot asked for: jackknife one sigma of its size
  std::vector<double> stability;   // the same: share of the fits in which it is there, 95 %
};
LeftOut leave_one_out(const Engine& engine, const ModelState& state, const std::vector<int>& slots);

// Every experiment predicted by a machine (nominal, and with the effects) that was fitted to the
// others.
Gain left_out_gain(const Engine& engine, const Nominal& nominal, const ModelState& extended,
                   const std::vector<int>& slots);
// The same with the machines that predict given, one per experiment; only those of `which` count.
Gain left_out_gain(const Engine& engine, const Nominal& nominal,
                   const std::vector<ModelState>& extended, const std::vector<bool>& which);
// Experiments of another campaign, predicted by the two states.
Gain held_out_gain(const Campaign& held_out, const ModelState& nominal, const ModelState& extended);

}  // namespace beltgrip::diagnose
