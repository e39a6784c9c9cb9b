// The other side of the blind test: a rig or a car with a pushbelt variator that may have an effect
// that the simulation under test does not know of. Its own equations, integrator (implicit, 1 ms),
// friction laws, sensors and random numbers: it shares no model code with what it examines.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace beltgrip::blind {

class Random {  // splitmix64 and Box-Muller: the same numbers on every machine
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  double uniform();  // [0, 1)
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  double log_uniform(double low, double high);
  double normal();
  int below(int n) { return static_cast<int>(uniform() * n); }

 private:
  std::uint64_t state_;
  bool have_spare_ = false;
  double spare_ = 0.0;
};

// An effect under its name of the model file; "x_..." are causes outside the library.
struct Planted {
  std::string effect;
  std::map<std::string, double> parameters;
  std::string role;  // channel_skew
};

enum class Setting { kRig, kRigNoOutputTorque, kCar };
enum class Law { kTanh, kExponential, kStribeck };

struct Machine {
  Setting setting = Setting::kRig;
  Law law = Law::kTanh;
  double mu_max = 0.1;
  double peak_slip_overdrive_share = 0.02, peak_slip_low_share = 0.03;
  double fall_per_unit = 0.15;  // of mu, per unit slip beyond the peak
  double deformation_per_kN = 1e-3;
  double loss_Nm = 0.5, loss_per_speed_Nms = 4e-3;
  double secondary_loss_Nm = 0.0, secondary_loss_per_speed_Nms = 0.0;  // behind the belt
  double ratio_error_overdrive = 0.0, ratio_error_low = 0.0;
  bool torque_ratio_stays = false;  // where pulleys give way: speed alone is lost
  double primary_inertia_kg_m2 = 0.18, secondary_inertia_kg_m2 = 0.3;
  // scatter between experiments, one sigma
  double scatter_friction = 3e-3, scatter_ratio = 1.5e-4, scatter_torque_Nm = 0.05;
  // sensors, one sigma per sample
  double noise_speed = 3e-4, noise_pressure_Pa = 1500.0, noise_torque_Nm = 0.25;
  double pressure_step_Pa = 1465.0;  // 12 bits over 6 MPa
  double pressure_swings_Pa = 0.0;   // one sigma, of the pressure itself, over a third of a second
  bool heavy_tails = false;
  double sample_rate_hz = 100.0;
  bool has_temperature = true, has_primary_pressure = true;
};

enum class Profile { kRamps, kTriangles, kTorqueSteps, kSpeedSweep, kMixed };

struct PlannedRun {
  bool low = false;
  double speed_rad_s = 105.0;  // primary on the rig, secondary * ratio in the car
  double torque_Nm = 50.0;     // signed
  double temperature_C = 80.0;
  double ramp_N_s = 100.0;
  Profile profile = Profile::kRamps;
  double duration_s = 60.0;
};

struct Trial {
  std::uint64_t seed = 0;
  Machine machine;
  std::vector<PlannedRun> plan;
  std::vector<Planted> planted;
};

// What the tool sees: one CSV text per experiment and the configuration's [variator] as text.
struct Recording {
  std::vector<std::string> csv;
  double seconds = 0.0;
};
Recording record(const Trial& trial);

Machine draw_machine(Random& random);
// A varied plan with three repeats of its first experiment; or the paper's (equal ramps).
std::vector<PlannedRun> draw_plan(Random& random, Setting setting, int runs);
std::vector<PlannedRun> paper_plan(int runs);
// The size met in practice of each parameter that can be planted, under "effect.parameter".
struct Plantable {
  std::string effect, parameter;
  double typical;
  bool positive;  // only one sign exists
};
const std::vector<Plantable>& plantables();
inline constexpr int kLaterPlantables = 2;  // of them, the last
// Drawn by the blind test.
const std::vector<std::string>& outside_causes();
// Planted by name alone.
const std::vector<std::string>& further_causes();
Planted draw_effect(Random& random, const Plantable& what, double size);
Planted draw_outside(Random& random, const std::string& cause, double size);

}  // namespace beltgrip::blind
