#include "tools/diagnose/decide/recipe.h"

#include "can_dbc/text/number_text.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kReaction_s = 0.1;  // chosen, of the scenario's operator

std::string number(double value) { return rounded_text(value, 5); }

}  // namespace

Recipe recipe(const estimator::VariatorParameters& v, const Ramp& ramp, const std::string& why) {
  const std::string stop = ramp.is_low ? "low" : "overdrive";
  Recipe out;
  out.text = why + ": " + stop + " end stop, " + number(ramp.speed_rad_s) + " rad/s, " +
             number(ramp.torque_Nm) + " Nm, oil at " + number(ramp.oil_C) +
             " degC; lower the clamp force from " + number(ramp.start_force_N) + " N by " +
             number(ramp.ramp_N_s) + " N/s until the belt slips by " +
             number(ramp.turn_slip_percent) + " %, raise it by " + number(ramp.grip_step_N) +
             " N at once and then by " + number(kRecipeRestore_N_s) + " N/s, go on for " +
             number(kRecipeLength_s) + " s";
  out.scenario =
      "# " + why + "\nname = \"next\"\n\n[variator]\nratio = " +
      number(ramp.is_low ? v.ratio_low : v.ratio_overdrive) +
      "\nsecondary_piston_area_m2 = " + number(v.secondary_piston_area_m2) +
      "\nsecondary_spring_force_N = " + number(v.secondary_spring_force_N) +
      "\n\n[driveline]\nprimary_speed_rad_s = " + number(ramp.speed_rad_s) +
      "\nprimary_torque_Nm = " + number(ramp.torque_Nm) +
      "\n\n[clamp]\nstart_force_N = " + number(ramp.start_force_N) +
      "\nhold_s = " + number(kRecipeHold_s) + "\nramp_N_per_s = " + number(ramp.ramp_N_s) +
      "\n\n[operator]\nslip_percent = " + number(ramp.turn_slip_percent) +
      "\nreaction_s = " + number(kReaction_s) + "\ngrip_step_N = " + number(ramp.grip_step_N) +
      "\nrestore_N_per_s = " + number(kRecipeRestore_N_s) +
      "\n\n[run]\nduration_s = " + number(kRecipeLength_s) +
      "\ncycles = 2\noil_degC = " + number(ramp.oil_C) + "\n";
  return out;
}

}  // namespace beltgrip::diagnose
