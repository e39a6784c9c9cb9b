#include "tools/diagnose/report/finding_words.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <utility>

#include "can_dbc/text/number_text.h"
#include "estimator/physics/machine_effects.h"

namespace beltgrip::diagnose {
namespace {

// How a person is told a size: words, those for one below zero (none: with its sign), unit, and
// times the SI value.
struct Words {
  std::string_view effect, parameter, words, opposite, unit;
  double per_SI = 1.0;
};
constexpr double kPercent = 100.0, kBarPerPa = 1e-5;
constexpr Words kWords[] = {
    {"torque_bias", "bias_Nm", "a measured torque that is too high by",
     "a measured torque that is too low by", "Nm"},
    {"torque_gain", "gain", "a measured torque that is too high by",
     "a measured torque that is too low by", "%", kPercent},
    {"inertia_torque", "inertia_kg_m2", "an inertia before the belt beyond the configured one,",
     "an inertia before the belt below the configured one, by", "kg m^2"},
    {"torque_delay", "delay_s", "a torque that comes late by", "a torque that comes early by", "s"},
    {"torque_loss", "constant_Nm", "a drag before the belt,", {}, "Nm"},
    {"torque_loss", "per_kN_Nm", "a drag that grows with the clamp force,",
     "a drag that falls with the clamp force, by", "Nm/kN"},
    {"torque_loss", "per_rad_s_Nm", "a drag that grows with the primary speed,",
     "a drag that falls with the primary speed, by", "Nm s/rad"},
    {"centrifugal_force", "coefficient_N_s2", "a clamp force of the turning oil,", {}, "N s^2"},
    {"pressure_offset", "offset_Pa", "a measured pressure that is too high by",
     "a measured pressure that is too low by", "bar", kBarPerPa},
    {"pressure_gain", "gain", "a measured pressure that is too high by",
     "a measured pressure that is too low by", "%", kPercent},
    {"spring_force", "force_N", "a spring that is stronger than configured by",
     "a spring that is weaker than configured by", "N"},
    {"hydraulic_lag", "time_constant_s", "a pressure that acts with a lag of", {}, "s"},
    {"hydraulic_lag", "delay_s", "a pressure that acts late by", "a pressure that acts early by",
     "s"},
    {"clamp_hysteresis", "force_N", "friction in the clamp force's way, with play,", {}, "N"},
    {"pulley_deformation", "per_kN", "pulleys that give way to the clamp force,", {}, "1/kN"},
    {"pulley_deformation",
     "per_kN2",
     "pulleys that give way to the clamp force's square,",
     {},
     "1/kN^2"},
    {"radius_tilt", "per_Nm", "a ratio that the torque tilts,", {}, "1/Nm"},
    {"end_stop_ratio", "low", "a ratio at the low end stop that is larger by",
     "a ratio at the low end stop that is smaller by", "%", kPercent},
    {"end_stop_ratio", "overdrive", "a ratio at the overdrive end stop that is larger by",
     "a ratio at the overdrive end stop that is smaller by", "%", kPercent},
    {"ratio_creep", "rate", "a ratio that leaves its end stop as the holding force falls,", {}, {}},
    {"friction_temperature", "per_K", "friction that grows with the oil temperature,",
     "friction that falls with the oil temperature, by", "% per K", kPercent},
    {"friction_speed", "per_ln_speed", "friction that grows with the logarithm of the speed, by",
     "friction that falls with the logarithm of the speed, by", "% per doubling",
     kPercent* std::numbers::ln2},
    {"friction_load",
     "exponent",
     "friction that falls with the clamp force, exponent",
     "friction that grows with the clamp force, exponent",
     {}},
    {"friction_ratio", "relative", "more friction at the low end stop, by",
     "less friction at the low end stop, by", "%", kPercent},
    {"friction_shape", "peak_slip_percent", "a peak of friction at another slip,", {}, "%"},
    {"friction_shape", "fall_per_percent", "friction that falls faster behind its peak,",
     "friction that falls more slowly behind its peak, by", "1/%"},
    {"wear", "step", "less friction from one experiment on, by",
     "more friction from one experiment on, by", "%", kPercent},
    {"wear", "per_experiment", "friction that falls with each experiment, by",
     "friction that grows with each experiment, by", "%", kPercent},
    {"warm_up_drift", "per_kJ", "friction that grows with the slip energy,",
     "friction that falls with the slip energy, by", "% per kJ", kPercent},
    {"warm_up_drift", "per_start", "friction that grows in the first minute, by",
     "friction that falls in the first minute, by", "%", kPercent},
    {"speed_scale", "primary", "a primary speed that is too high by",
     "a primary speed that is too low by", "%", kPercent},
    {"speed_scale", "secondary", "a secondary speed that is too high by",
     "a secondary speed that is too low by", "%", kPercent},
    {"speed_ripple", "primary", "a ripple of the primary speed over its turn,", {}, "%", kPercent},
    {"speed_ripple",
     "secondary",
     "a ripple of the secondary speed over its turn,",
     {},
     "%",
     kPercent},
    {"channel_skew", "delay_s", "a channel that comes late by", "a channel that comes early by",
     "s"},
    {"secondary_loss", "constant_Nm", "a drag behind the belt,", {}, "Nm"},
    {"secondary_loss",
     "per_rad_s_Nm",
     "a drag behind the belt that grows with its speed,",
     {},
     "Nm s/rad"},
};

// What a signal, an error of it or a function on it is told in.
struct ToldUnit {
  std::string_view ends_with;
  Display display;
};
constexpr ToldUnit kToldUnits[] = {
    {"torque_gain", {"%", kPercent}}, {"torque", {"Nm"}},         {"speed", {"rad/s"}},
    {"pressure", {"bar", kBarPerPa}}, {"temperature", {"degC"}},  {"clamp_force", {"N"}},
    {"friction", {"%", kPercent}},    {"ratio", {"%", kPercent}}, {"slip", {"%", kPercent}},
    {"mu_max", {"%", kPercent}},
};

const Words* row_of(std::string_view effect, std::string_view parameter) {
  const auto found = std::find_if(std::begin(kWords), std::end(kWords), [&](const Words& each) {
    return each.effect == effect && each.parameter == parameter;
  });
  return found == std::end(kWords) ? nullptr : &*found;
}

// A value to the place of the second digit of its half width.
std::string size_of(const Interval& size) {
  const double half = 0.5 * (size.high - size.low);
  int digits = 3;
  if (half > 0.0 && size.value != 0.0 && std::isfinite(half)) {
    const double places =
        std::floor(std::log10(std::abs(size.value))) - std::floor(std::log10(half));
    digits = std::clamp(static_cast<int>(places) + 2, 2, 9);
  }
  const bool even = std::abs(size.high + size.low - 2.0 * size.value) < 0.1 * half;
  return even ? readable(size.value, digits) + " ± " + readable(half, 2)
              : readable(size.value, digits) + " (" + readable(size.low, digits) + " to " +
                    readable(size.high, digits) + ")";
}

}  // namespace

std::string readable(double value, int digits) {
  constexpr double kReadable = 1e6;  // chosen: longer ones are counted, not read; decides no more
  std::string text = rounded_text(value, digits);
  if (text.find("e+") == std::string::npos || !(std::abs(value) < kReadable)) return text;
  const double last = std::pow(10.0, std::floor(std::log10(std::abs(value))) + 1.0 - digits);
  return fixed_text(last * std::round(value / last), 0);
}

std::string words_of(std::string_view effect, std::string_view parameter, double size) {
  const Words* const row = row_of(effect, parameter);
  if (row == nullptr) return {};
  std::string_view words = size < 0.0 && !row->opposite.empty() ? row->opposite : row->words;
  for (const std::string_view end : {", by", ", exponent", ",", " by", " of"}) {
    if (words.ends_with(end)) words.remove_suffix(end.size());
  }
  return std::string(words);
}

std::string_view words_of_test(std::string_view test) {
  struct TestWords {
    std::string_view test, words;
  };
  static constexpr std::array kAll{
      TestWords{"law_cell", "a step, kink or bump over a recorded variable, twice the log odds"},
      TestWords{"smooth_cell", "a smooth function of a recorded variable, twice the log odds"},
      TestWords{"held_cell",
                "friction, ratio or force that follows what experiments hold, twice the log odds"},
      TestWords{"own_shape", "another course over what a finding follows, twice the log odds"},
      TestWords{"group", "functions of a recorded variable beside the findings, chi-square"},
      TestWords{"line", "a line in what each sample says of friction, ratio or torque, sigmas"},
      TestWords{"slow_line", "a swing between 0.2 and 0.7 Hz, sigmas"},
      TestWords{"channel_line", "a line in a torque as it was sampled, times the level about it"},
      TestWords{"torque_swing", "a shaft that swings, sigmas"},
      TestWords{"slip_swing", "a swing of one speed that the other does not make, sigmas"},
      TestWords{"belt_passage", "a line at the belt's passage, sigmas"},
      TestWords{"whiteness", "samples that follow from those before, decades of chance"},
      TestWords{"scatter_friction",
                "friction that differs between experiments, times the expected"},
      TestWords{"scatter_ratio", "a ratio that differs between experiments, times the expected"},
      TestWords{"scatter_torque",
                "a torque's zero that differs between experiments, times the expected"},
      TestWords{"unusual_scatter", "friction or a torque's zero that differs, times the usual"},
      TestWords{"unusual_ratio", "a ratio that differs between experiments, times the usual"},
      TestWords{"unusual_friction", "friction that differs between experiments, times the usual"}};
  const auto found = std::find_if(kAll.begin(), kAll.end(),
                                  [&](const TestWords& each) { return each.test == test; });
  return found == kAll.end() ? std::string_view() : found->words;
}

Display display_of(std::string_view what) {
  const auto found =
      std::find_if(std::begin(kToldUnits), std::end(kToldUnits),
                   [&](const ToldUnit& each) { return what.ends_with(each.ends_with); });
  return found == std::end(kToldUnits) ? Display{} : found->display;
}

std::string told(std::string_view what, double value, int digits) {
  const Display shown = display_of(what);
  return readable(value * shown.per_SI, digits) +
         (shown.unit.empty() ? "" : " " + std::string(shown.unit));
}

std::string told_change(std::string_view what, double before, double after, double low,
                        double high) {
  const Display shown = display_of(what);
  constexpr int kDigits = 4;
  const auto text = [&](double value) { return readable(value * shown.per_SI, kDigits); };
  return text(before) + " -> " + text(after) + " [" + text(low) + ", " + text(high) + "]" +
         (shown.unit.empty() ? "" : " " + std::string(shown.unit));
}

std::string_view unit_of(std::string_view effect, std::string_view parameter) {
  for (const estimator::EffectRow& row : estimator::effect_rows()) {
    if (row.id == effect && row.parameter == parameter) return row.unit;
  }
  return {};
}

std::string in_words(const Finding& finding) {
  std::string out;
  for (const auto& [name, size] : finding.parameters) {
    const Words* const row = row_of(finding.effect, name);
    if (row == nullptr) continue;
    const bool is_opposite = size.value < 0.0 && !row->opposite.empty();
    const double by = is_opposite ? -row->per_SI : row->per_SI;
    Interval told{size.value * by, size.low * by, size.high * by};
    if (told.low > told.high) std::swap(told.low, told.high);
    out += (out.empty() ? "" : ", ") + std::string(is_opposite ? row->opposite : row->words) + " " +
           size_of(told) + (row->unit.empty() ? "" : " " + std::string(row->unit));
  }
  if (!finding.from_file.empty()) out += ", from " + finding.from_file + " on";
  return out + " (" + finding.effect + (finding.role.empty() ? "" : ", " + finding.role) + ")";
}

}  // namespace beltgrip::diagnose
