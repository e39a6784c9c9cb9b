// The machine's constants with their intervals, mu_max among them, and the notes on them.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "tools/diagnose/data/diagnosis.h"
#include "tools/diagnose/decide/criticism.h"
#include "tools/diagnose/decide/learn.h"
#include "tools/diagnose/decide/namer.h"
#include "tools/diagnose/infer/engine.h"
#include "tools/diagnose/infer/uncertainty.h"

namespace beltgrip::diagnose {

class ToldMachine {
 public:
  // out: gets machine and notes; outlives this.
  ToldMachine(const Accuracies& accuracies, bool is_model_given, Diagnosis& out)
      : accuracies_(accuracies), is_model_given_(is_model_given), out_(out) {}

  void fill(const Engine& engine, const Naming& naming);
  // What the interval of mu_max has beside, after fill.
  void count_learned(const Engine& engine, const Learning& learning);
  void count_unexplained(const Engine& engine, const Naming& naming, const Criticism& left);
  void no_mu_max(const std::string& why);
  bool has_play() const;  // of its own, that no name stands for
  // Of mu_max; empty where other errors are larger.
  const LeftOpen& open() const { return open_; }

 private:
  void widen_mu_max(double variance);
  void note_torque_ratio();
  void note_play();
  void note_torque_from_nothing(const Campaign& campaign);
  void tell_turning_oil(const Engine& engine);
  std::vector<Score> unseen_in(const Campaign& campaign, const Naming& naming) const;
  void note_open();
  double mu_of_sensors(const Engine& engine) const;
  void tell_machine(const std::string& name, const Interval& fitted, double of_model,
                    bool is_different);

  const Accuracies& accuracies_;
  bool is_model_given_;
  Diagnosis& out_;
  Eigen::VectorXd mu_height_;  // change of ln mu_max per column of the fit
  LeftOpen open_;
};

}  // namespace beltgrip::diagnose
