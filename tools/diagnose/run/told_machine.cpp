#include "tools/diagnose/run/told_machine.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string_view>

#include "estimator/statistics/interval.h"
#include "tools/diagnose/data/text_of.h"
#include "tools/diagnose/infer/peak.h"
#include "tools/diagnose/model/curve_family.h"

namespace beltgrip::diagnose {
namespace {

const EffectRow* row_of(const std::string& id) {
  return &*std::find_if(effect_rows().begin(), effect_rows().end(),
                        [&](const EffectRow& row) { return row.id == id; });
}

// Mean magnitude of a channel over the samples that count.
double typical(const Engine& engine, GridSignal ExperimentData::*channel) {
  double sum = 0.0, count = 1e-9;
  for (const ExperimentData& run : engine.campaign().runs) {
    for (int k = 0; k < run.size(); ++k) {
      if (!run.valid[static_cast<std::size_t>(k)]) continue;
      sum += std::abs((run.*channel).value[k]);
      count += 1.0;
    }
  }
  return std::max(sum / count, 1e-9);
}

// What the function that stands out comes to in the friction, relative, about its mean.
double friction_variance(const Engine& engine, const Cell& cell) {
  double per_unit = 0.0;
  switch (cell.injection->injection) {
    case Injection::kFriction:
    case Injection::kTorqueGain:
      per_unit = cell.injection->unit;
      break;
    case Injection::kTorque:
      per_unit = cell.injection->unit / typical(engine, &ExperimentData::torque);
      break;
    case Injection::kClampForce:
      per_unit = cell.injection->unit / (engine.campaign().variator.secondary_piston_area_m2 *
                                         typical(engine, &ExperimentData::pressure));
      break;
    case Injection::kRatio:
      return 0.0;
  }
  const Eigen::ArrayXd off = cell.mean.array() - cell.mean.mean();
  return per_unit * per_unit * off.square().mean();
}

// Beyond doubt, and by more than two machines of one type do.
bool differs(double off, double sigma, double tolerance) {
  constexpr double kSure = 5.0;  // chosen, sigmas: of some twenty constants none by chance
  return std::abs(off) > tolerance && std::abs(off) > kSure * sigma;
}

// Of the clamp force, about what the pressure makes of it.
double share_of_pressure(const Engine& engine) {
  const estimator::VariatorParameters& variator = engine.campaign().variator;
  const double by_pressure_N =
      variator.secondary_piston_area_m2 * typical(engine, &ExperimentData::pressure);
  return by_pressure_N / (by_pressure_N + variator.secondary_spring_force_N);
}

// What another member of the class in a name's place would have mu_max differ by, one sigma: by
// their probabilities beside the name's.
double mu_of_class(const Engine& engine, const Naming& naming, const FittedPeak& peak, int stop) {
  double weights = 1.0, squares = 0.0;
  for (const Accepted& each : naming.accepted) {
    for (const Hypothesis& other : each.in_its_place) {
      const double weight = std::exp(other.log_evidence - naming.hypothesis.log_evidence);
      const double off = fitted_peak(engine, other, stop).ln_mu - peak.ln_mu;
      weights += weight;
      squares += weight * off * off;
    }
  }
  return std::sqrt(squares / weights);
}

}  // namespace

void ToldMachine::fill(const Engine& engine, const Naming& naming) {
  const Fit& fit = naming.hypothesis.fit;
  for (std::size_t j = 0; j < engine.active_nuisances().size(); ++j) {
    const int p = engine.active_nuisances()[j];
    const auto i = static_cast<Eigen::Index>(j);
    double variance = fit.covariance(i, i) * engine.scale(p) * engine.scale(p);
    if (const int first = first_knot(p); first >= 0) {
      // At the low end stop the form in overdrive counts as well, where that is used.
      Eigen::VectorXd lever = Eigen::VectorXd::Zero(fit.covariance.rows());
      for (std::size_t k = 0; k < engine.active_nuisances().size(); ++k) {
        const int q = engine.active_nuisances()[k];
        const int of = first_knot(q);
        if (of != first && !(of == kShapeOverdrive && first == kShapeLow)) continue;
        lever[static_cast<Eigen::Index>(k)] = curve_modes()(p - first, q - of) * engine.scale(q);
      }
      variance = lever.dot(fit.covariance * lever);
    }
    const double sigma = std::sqrt(std::max(variance, 0.0));
    const Campaign& campaign = engine.campaign();
    const double of_model = p == kPlay_N ? play_of(campaign, campaign.switched_on) : 0.0;
    const double value = of_model + naming.hypothesis.state.nuisance[p];
    // The curve's own peak and slip are the fit's; what they come to is told below.
    if (p == kLnMuMax || p == kLnPeakSlipOverdrive || p == kLnPeakSlipLow) continue;
    if (p == kPlay_N && any_play(engine.campaign(), engine.accepted())) continue;
    const std::string name(engine.campaign().nuisances[static_cast<std::size_t>(p)].name);
    const Interval fitted{value, value - estimator::kNormal95 * sigma,
                          value + estimator::kNormal95 * sigma};
    const NuisanceRow& row = engine.campaign().nuisances[static_cast<std::size_t>(p)];
    const bool is_shape = first_knot(p) >= 0;
    tell_machine(name, fitted, row.nominal,
                 !is_shape && differs(value - row.nominal, sigma, row.tolerance));
  }
  for (const int stop : {kLowStop, kOverdriveStop}) {  // mu_max of the overdrive where it is used
    if (!uses_stop(engine, stop)) continue;
    const FittedPeak peak = fitted_peak(engine, naming.hypothesis, stop);
    const auto tell = [&](const std::string& name, double ln, double sigma, int p) {
      const double half = estimator::kNormal95 * sigma;
      const NuisanceRow& row = engine.campaign().nuisances[static_cast<std::size_t>(p)];
      tell_machine(name, {std::exp(ln), std::exp(ln - half), std::exp(ln + half)},
                   std::exp(row.nominal), differs(ln - row.nominal, sigma, row.tolerance));
    };
    const bool low = stop == kLowStop;
    tell(low ? "peak_slip_low" : "peak_slip_overdrive", peak.ln_slip, peak.ln_slip_sigma,
         low ? kLnPeakSlipLow : kLnPeakSlipOverdrive);
    if (low && uses_stop(engine, kOverdriveStop)) continue;
    const double seen = std::hypot(peak.ln_mu_sigma, mu_of_class(engine, naming, peak, stop),
                                   mu_of_sensors(engine));
    mu_height_ = peak.height;
    open_ = left_open(engine, unseen_in(engine.campaign(), naming), peak.height);
    const double pushed = variance_of_pushed(engine, naming.hypothesis, peak.height);
    tell("mu_max", peak.ln_mu, std::hypot(seen, std::sqrt(open_.variance + pushed)), kLnMuMax);
    if (open_.variance > seen * seen) {
      note_open();
    } else {
      open_ = {};
    }
  }
  note_torque_ratio();
  note_play();
  note_torque_from_nothing(engine.campaign());
  tell_turning_oil(engine);
}

// A function that was learned is about its mean over the experiments; where on it the machine's
// own friction lies is not known.
void ToldMachine::count_learned(const Engine& engine, const Learning& learning) {
  double variance = 0.0;
  for (const Learned& each : learning.terms) variance += friction_variance(engine, each.fit.cell);
  if (variance > 0.0 && out_.machine.contains("mu_max")) widen_mu_max(variance);
}

// What is left unexplained stands in the level of the friction as well: which of the experiments,
// or which value of what it follows, is the machine's own cannot be said.
void ToldMachine::count_unexplained(const Engine& engine, const Naming& naming,
                                    const Criticism& left) {
  if (!out_.unexplained || left.tests.empty() || !out_.machine.contains("mu_max")) return;
  const Scatter& scatter = engine.scatter();
  if (is_beyond_scatter(scatter)) {
    no_mu_max("experiments differ by more than friction scatters, for no reason found");
    return;
  }
  double variance = 0.0;
  const auto fails = [&](const char* name) { return !left.test(name).passed(); };
  if (fails("scatter_friction") || fails("unusual_friction")) variance += scatter.variance[0];
  if (left.function_fails()) variance += friction_variance(engine, left.cells.front());
  widen_mu_max(variance + variance_of_halves(engine, naming.last_screen, mu_height_) +
               variance_of_bending(engine, naming.hypothesis, mu_height_));
}

void ToldMachine::no_mu_max(const std::string& why) {
  out_.machine.erase("mu_max");
  out_.notes.push_back("mu_max: " + why + "; no value");
}

// variance: of its logarithm, beside what its interval counts.
void ToldMachine::widen_mu_max(double variance) {
  Interval& told = out_.machine.at("mu_max");
  const double half =
      std::hypot(0.5 * std::log(told.high / told.low), estimator::kNormal95 * std::sqrt(variance));
  told.low = told.value * std::exp(-half);
  told.high = told.value * std::exp(half);
  if (half > estimator::kNormal95 * default_nuisances()[kLnMuMax].tolerance) {
    no_mu_max("what is left unexplained may have it off by more than belts differ");
  }
}

void ToldMachine::note_torque_ratio() {
  const auto share = out_.machine.find("deformation_lost_share");
  if (share == out_.machine.end()) return;
  out_.notes.push_back(
      "the ratio of the torques does not follow pulleys that give way: a share of " +
      text_of(share->second.value) + " of it takes speed alone, as slip does");
}

bool ToldMachine::has_play() const {
  const auto play = out_.machine.find("clamp_play_N");
  return play != out_.machine.end() && play->second.low > 0.0;
}

void ToldMachine::note_play() {
  if (!has_play() || out_.machine.at("clamp_play_N").value > kUsualPlay_N) return;
  const Interval& play = out_.machine.at("clamp_play_N");
  out_.notes.push_back(
      "clamp_play_N: " + text_of(play.value) + " (" + text_of(play.low) + " to " +
      text_of(play.high) +
      "): friction in the clamp force's way, of which any machine may have up to " +
      text_of(kUsualPlay_N) + " N; no finding");
}

// A zero of the torque sensor looks like a constant loss, of either sign; beyond what was stated
// of it a loss below nothing is something else's.
void ToldMachine::note_torque_from_nothing(const Campaign& campaign) {
  const auto loss = out_.machine.find("loss_constant_Nm");
  if (loss == out_.machine.end()) return;
  const Role measured =
      campaign.runs[0].torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque;
  const double zero_Nm = accuracies_[static_cast<std::size_t>(measured)].bias;
  if (loss->second.high >= -estimator::kNormal95 * zero_Nm) return;
  out_.notes.push_back("loss_constant_Nm: " + text_of(loss->second.value) + " (" +
                       text_of(loss->second.low) + " to " + text_of(loss->second.high) +
                       "): no machine makes torque; the torque reads too little by as much, or "
                       "what is wrong stands elsewhere");
}

// A gain of the pressure by as much looks the same, and has another friction.
void ToldMachine::tell_turning_oil(const Engine& engine) {
  const auto off = out_.machine.find("secondary_centrifugal_off_N_s2");
  if (off == out_.machine.end() || off->second.low * off->second.high < 0.0) return;
  const double told = engine.campaign().variator.secondary_centrifugal_N_s2;
  out_.notes.push_back("secondary_centrifugal_N_s2: " + text_of(told) + " as told, " +
                       text_of(told + off->second.low) + " to " + text_of(told + off->second.high) +
                       " by these data, or the pressure has a gain by as much");
  if (!out_.machine.contains("mu_max")) return;
  widen_mu_max(std::pow(off->second.value / told * share_of_pressure(engine), 2.0));
}

// Effects that these data do not show. What somebody stated a sensor to be accurate to
// is counted as that.
std::vector<Score> ToldMachine::unseen_in(const Campaign& campaign, const Naming& naming) const {
  std::map<std::string_view, bool> is_plain;
  for (const Score& score : naming.last_screen) {
    const Slot& slot = campaign.slots[static_cast<std::size_t>(score.slot)];
    is_plain[slot.row->id] |= is_seen(score, slot);
  }
  for (const Accepted& each : naming.accepted) {
    is_plain[campaign.slots[static_cast<std::size_t>(each.slot)].row->id] = true;
  }
  const auto& torque = accuracies_[static_cast<std::size_t>(
      campaign.runs[0].torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque)];
  const auto& pressure = accuracies_[static_cast<std::size_t>(Role::kSecondaryPressure)];
  is_plain["torque_bias"] |= torque.bias > 0.0;
  is_plain["torque_gain"] |= torque.gain > 0.0;
  is_plain["pressure_offset"] |= pressure.bias > 0.0;
  is_plain["pressure_gain"] |= pressure.gain > 0.0;
  is_plain["clamp_hysteresis"] |= campaign.pressure_moves;  // a constant of the machine
  std::vector<Score> out;
  for (const Score& score : naming.last_screen) {
    const Slot& slot = campaign.slots[static_cast<std::size_t>(score.slot)];
    if (!is_plain[slot.row->id]) out.push_back(score);
  }
  return out;
}

// Which effects are behind an interval of mu_max that is wide for what was not seen.
void ToldMachine::note_open() {
  constexpr std::size_t kNamed = 3;
  std::string names;
  for (std::size_t i = 0; i < std::min(kNamed, open_.by_effect.size()); ++i) {
    names += (i == 0 ? "" : ", ") + open_share(open_.by_effect[i]);
  }
  out_.notes.push_back(
      "mu_max: known to " + text_of(100.0 * std::sqrt(open_.variance)) +
      " % for what these experiments cannot show, were it there at its usual "
      "size: " +
      names + "; to see the first: " +
      std::string(row_of(std::string(open_.by_effect.front().effect))->separating));
}

// What the gains of torque and pressure may have it off by, as far as somebody stated them, one
// sigma: nothing in these data says more of them. Constant errors are constants of the fit.
double ToldMachine::mu_of_sensors(const Engine& engine) const {
  const Campaign& campaign = engine.campaign();
  const auto accuracy = [&](Role role) { return accuracies_[static_cast<std::size_t>(role)]; };
  const bool is_engine = campaign.runs[0].torque_is_engine;
  const auto torque = accuracy(is_engine ? Role::kEngineTorque : Role::kPrimaryTorque);
  const auto pressure = accuracy(Role::kSecondaryPressure);
  return std::hypot(torque.gain, pressure.gain * share_of_pressure(engine));
}

void ToldMachine::tell_machine(const std::string& name, const Interval& fitted, double of_model,
                               bool is_different) {
  if (is_model_given_ && is_different) {
    out_.notes.push_back(name + ": the model has " + text_of(of_model) + ", these data say " +
                         text_of(fitted.value) + " (" + text_of(fitted.low) + " to " +
                         text_of(fitted.high) +
                         "), which counts as the machine's own and is no finding");
  }
  out_.machine[name] = fitted;
}

}  // namespace beltgrip::diagnose
