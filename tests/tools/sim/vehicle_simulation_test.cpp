// The vehicle as a whole: scenarios do what their headers say, the controller obeys and lets go,
// the same seed gives the same bytes, faults are faults, a state that is no number ends the run.
#include "tools/sim/vehicle_simulation.h"
#include "tools/sim/configuration.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include <cmath>
#include <map>

#include "can_dbc/frame/e2e.h"
#include "tools/sim/vehicle_port.h"
#include "tools/sim/vehicle_scenario.h"

namespace beltgrip::sim {
namespace {

VehicleScenario scenario(const char* name, const std::vector<std::string>& settings = {}) {
  std::vector<ScenarioLayer> layers;
  for (const std::string& setting : settings) layers.push_back(setting_layer(setting));
  VehicleScenarioResult result = shipped_vehicle_scenario(name, layers);
  EXPECT_TRUE(result.errors.empty()) << result.errors.front();
  return result.scenario;
}

double seconds(const VehicleSimulation& simulation) {
  return static_cast<double>(simulation.now_ns()) * 1e-9;
}

// Asks for a force as the daemon would: inactive frames, then a falling request every 10 ms.
class Requester {
 public:
  explicit Requester(VehicleSimulation& vehicle) : vehicle_(vehicle) {}
  void ask(unsigned force_N) {
    can::CanFrame frame;
    frame.id = {0x6A2, false};
    frame.length = 8;
    frame.data[2] = force_N > 0 ? 1 : 0;
    frame.data[3] = static_cast<std::uint8_t>(force_N & 0xFFU);
    frame.data[4] = static_cast<std::uint8_t>(force_N >> 8);
    can::e2e::protect(frame, 0x6A2, counter_);
    counter_ = can::e2e::next_counter(counter_);
    vehicle_.deliver(frame, vehicle_.now_ns());
  }
  void run_s(double time_s) {
    const double until = seconds(vehicle_) + time_s;
    while (seconds(vehicle_) < until - 1e-9) vehicle_.step();
  }

 private:
  VehicleSimulation& vehicle_;
  std::uint8_t counter_ = 0;
};

TEST(Scenarios, CoastOverdriveIsWhatItSays) {
  VehicleSimulation vehicle(scenario("coast-overdrive"), 1);
  double fit_s = 0.0;
  while (!vehicle.finished()) {
    vehicle.step();
    const Signals& s = vehicle.signals();
    const double speed_km_h = 3.6 * s.speed_m_s;
    if (speed_km_h < 60.0 || speed_km_h > 70.0 || seconds(vehicle) < 4.5) continue;
    fit_s += 5e-4;
    ASSERT_LT(s.torque_e_Nm, -30.0);
    ASSERT_EQ(vehicle.truth().ratio, 2.25);
    ASSERT_EQ(s.experiment_permitted, 1.0);
    ASSERT_EQ(s.lockup_closed, 1.0);
    // The pressure floor of 20 kPa leaves less force than the peak needs.
    const double floor_N = 500.0 + 0.0113 * 2e4 + 9.5e-3 * s.omega_s_rad_s * s.omega_s_rad_s;
    ASSERT_GT(-s.torque_e_Nm * 0.98163 / (2.0 * 0.07837 * floor_N), 0.105);
  }
  EXPECT_GT(fit_s, 5.0);
}

TEST(Scenarios, UnreachableIsOutOfReach) {
  VehicleSimulation vehicle(scenario("coast-overdrive-unreachable"), 1);
  int permitted = 0;
  while (!vehicle.finished()) {
    vehicle.step();
    const Signals& s = vehicle.signals();
    if (s.experiment_permitted < 0.5 || s.torque_e_Nm > -15.0) continue;
    ++permitted;
    const double floor_N = 500.0 + 0.0113 * 1e5 + 9.5e-3 * s.omega_s_rad_s * s.omega_s_rad_s;
    ASSERT_LT(-s.torque_e_Nm * 0.98163 / (2.0 * 0.07837 * floor_N), 0.07);
  }
  EXPECT_GT(permitted, 10'000);
}

TEST(Scenarios, DriveTorqueIsSteadyAndColdOilIsNotPermitted) {
  VehicleSimulation cruise(scenario("cruise-drive-torque"), 1);
  while (!cruise.finished()) {
    cruise.step();
    if (seconds(cruise) < 20.0) continue;
    ASSERT_NEAR(cruise.signals().torque_e_Nm, 36.0, 5.0);
    ASSERT_EQ(cruise.truth().ratio, 2.25);
  }
  VehicleSimulation cold(scenario("cold-oil"), 1);
  while (!cold.finished()) {
    cold.step();
    ASSERT_EQ(cold.signals().experiment_permitted, 0.0);
  }
}

TEST(Scenarios, CoastLowReachesLow) {
  VehicleSimulation vehicle(scenario("coast-low"), 1);
  double permitted_s = 0.0;
  while (!vehicle.finished()) {
    vehicle.step();
    if (vehicle.signals().experiment_permitted > 0.5 && vehicle.signals().torque_e_Nm < -15.0) {
      ASSERT_NEAR(vehicle.truth().ratio, 0.405, 0.01);
      permitted_s += 5e-4;
    }
  }
  EXPECT_GT(permitted_s, 3.0);
}

TEST(Scenarios, CityMeetsEverythingThatInhibits) {
  VehicleSimulation vehicle(scenario("city"), 7);
  std::map<std::string, int> seen;
  while (!vehicle.finished()) {
    vehicle.step();
    ASSERT_TRUE(vehicle.finite());
    const Signals& s = vehicle.signals();
    ASSERT_LT(std::abs(vehicle.truth().belt.slip_share), 0.10) << seconds(vehicle);
    if (s.speed_m_s < 0.1) ++seen["standing"];
    if (s.brake_pressed > 0.5) ++seen["brake"];
    if (s.lockup_closed < 0.5 && s.speed_m_s > 10.0) ++seen["open lock-up"];
    if (s.oil_degC < 40.0) ++seen["cold"];
    if (s.accelerator > 0.95) ++seen["kick-down"];
    if (s.experiment_permitted > 0.5 && s.torque_e_Nm < -10.0) ++seen["permitted"];
    if (s.accelerator == 0.0 && s.speed_m_s > 5.0 && s.experiment_permitted < 0.5) ++seen["not"];
  }
  for (const char* what :
       {"standing", "brake", "open lock-up", "cold", "kick-down", "permitted", "not"}) {
    EXPECT_GT(seen[what], 100) << what;
  }
  EXPECT_EQ(vehicle.truth().stalls, 0);
}

// The foot is lifted: the engine's torque passes zero, and the belt is loaded the other way with
// the next breath. The own law rests on what is asked for and holds on.
TEST(OwnLaw, HoldsThroughAReversalOfTheTorque) {
  VehicleSimulation vehicle(scenario("coast-overdrive"), 1);
  double least_N = 1e9, least_torque_Nm = 1e9, most_torque_Nm = -1e9;
  while (seconds(vehicle) < 4.0) {
    vehicle.step();
    if (seconds(vehicle) < 3.02) continue;
    least_N = std::min(least_N, vehicle.tcu().own_force_N);
    least_torque_Nm = std::min(least_torque_Nm, vehicle.signals().torque_e_Nm);
    most_torque_Nm = std::max(most_torque_Nm, vehicle.signals().torque_e_Nm);
  }
  EXPECT_LT(least_torque_Nm, -25.0);
  EXPECT_GT(most_torque_Nm, 5.0);
  EXPECT_GT(least_N, 0.97 * vehicle.tcu().own_force_N);
}

class Controller : public testing::Test {
 protected:
  Controller() : vehicle_(scenario("coast-overdrive"), 1), requester_(vehicle_) {
    requester_.run_s(5.0);
    requester_.ask(0);
    requester_.run_s(0.01);
    requester_.ask(0);
  }
  VehicleSimulation vehicle_;
  Requester requester_;
};

TEST_F(Controller, ObeysWithinItsLimitsAndReturnsFiftyMillisecondsAfterTheLastFrame) {
  const double own_N = vehicle_.tcu().own_force_N;
  for (unsigned i = 0; i < 100; ++i) {
    requester_.run_s(0.01);
    requester_.ask(4000 - 5 * i);
  }
  requester_.run_s(0.012);
  EXPECT_TRUE(vehicle_.tcu().obeying);
  EXPECT_NEAR(vehicle_.tcu().force_N, 3505.0, 1.0);
  EXPECT_GT(vehicle_.tcu().own_force_N, own_N - 200.0);
  requester_.run_s(0.035);
  EXPECT_TRUE(vehicle_.tcu().obeying);
  requester_.run_s(0.025);
  EXPECT_FALSE(vehicle_.tcu().obeying);
  EXPECT_EQ(vehicle_.tcu().force_N, vehicle_.tcu().own_force_N);
  ASSERT_EQ(vehicle_.requests().size(), 1u);
  EXPECT_LT(vehicle_.requests()[0].force_min_N, 3800.0);
}

TEST_F(Controller, NeverGoesBelowItsFloor) {
  for (int i = 0; i < 600; ++i) {
    requester_.run_s(0.01);
    requester_.ask(1);
    ASSERT_GE(vehicle_.tcu().force_N, 1200.0);
  }
}

TEST_F(Controller, WithdrawsWhenTheDriverBrakes) {
  VehicleSimulation vehicle(
      scenario("coast-overdrive",
               {"fault=[{kind=\"brake\",at_s=0.3,for_s=5,size=2,after_request=true}]"}),
      1);
  Requester requester(vehicle);
  requester.run_s(5.0);
  requester.ask(0);
  requester.run_s(0.01);
  requester.ask(0);
  for (int i = 0; i < 60; ++i) {
    requester.run_s(0.01);
    requester.ask(3800);
  }
  EXPECT_EQ(vehicle.signals().experiment_permitted, 0.0);
  EXPECT_EQ(vehicle.tcu().force_N, vehicle.tcu().own_force_N);
}

std::vector<can::StampedFrame> frames(const VehicleScenario& s, std::uint64_t seed,
                                      double until_s) {
  VehiclePort port(s, seed);
  std::vector<can::StampedFrame> out;
  std::array<daemon::RxFrame, 16> batch;
  for (;;) {
    const daemon::Wake wake = port.wait_until(daemon::MonoTime::of_ns(std::llround(until_s * 1e9)));
    if (wake != daemon::Wake::kFrames) break;
    const std::size_t count = port.receive(batch);
    for (std::size_t i = 0; i < count; ++i) out.push_back({batch[i].t.ns(), batch[i].frame});
  }
  return out;
}

TEST(VehiclePort, SameSeedSameBytes) {
  const VehicleScenario s = scenario("coast-overdrive");
  const auto a = frames(s, 3, 6.0);
  const auto b = frames(s, 3, 6.0);
  const auto c = frames(s, 4, 6.0);
  ASSERT_EQ(a.size(), b.size());
  bool differs = a.size() != c.size();
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].t_ns, b[i].t_ns);
    ASSERT_EQ(a[i].frame, b[i].frame);
    differs = differs || !(a[i].frame == c[i].frame);
  }
  EXPECT_TRUE(differs);
}

TEST(VehiclePort, EveryMessageComesInItsOwnPeriodWithJitterAndInOrder) {
  const auto all = frames(scenario("coast-overdrive"), 1, 5.0);
  std::map<std::uint32_t, std::vector<double>> stamps_ms;
  std::int64_t last = 0;
  for (const auto& frame : all) {
    EXPECT_GE(frame.t_ns, last);
    last = frame.t_ns;
    stamps_ms[frame.frame.id.value].push_back(static_cast<double>(frame.t_ns) * 1e-6);
  }
  ASSERT_EQ(stamps_ms.size(), 5u);
  for (const auto& [id, stamps] : stamps_ms) {
    const double period_ms = id == 528 ? 20.0 : 10.0;
    EXPECT_NEAR(static_cast<double>(stamps.size()), 5000.0 / period_ms, 1.0);
    double shortest = 1e9, longest = 0.0;
    for (std::size_t i = 1; i < stamps.size(); ++i) {
      shortest = std::min(shortest, stamps[i] - stamps[i - 1]);
      longest = std::max(longest, stamps[i] - stamps[i - 1]);
    }
    EXPECT_GT(longest - shortest, 0.3);
    EXPECT_LT(longest, period_ms + 1.3);
  }
}

TEST(VehiclePort, APressureThatComesSlowlyIsAloneInIt) {
  VehicleScenario slow = scenario("coast-overdrive");
  slow.sensors.pressure_period_s = 0.1;
  std::map<std::uint32_t, int> counts;
  for (const auto& frame : frames(slow, 1, 5.0)) ++counts[frame.frame.id.value];
  EXPECT_NEAR(counts[304], 50, 1);
  EXPECT_NEAR(counts[288], 500, 1);
  EXPECT_NE(vehicle_configuration(slow, "can0", "vehicle.dbc")
                .find("{ signal = \"TCU_Pressure.SecondaryPressure\", period_ms = 100 }"),
            std::string::npos);
}

// Values of one signal by the DBC's own codec.
std::vector<double> values(const std::vector<can::StampedFrame>& all, const char* message,
                           const char* signal) {
  std::vector<double> out;
  for (const can::MessageDef& m : vehicle_database().messages) {
    if (m.name != message) continue;
    for (const can::SignalDef& s : m.signals) {
      if (s.name != signal) continue;
      const can::SignalCodec codec(s);
      for (const auto& f : all) {
        if (f.frame.id == m.id && f.frame.length == m.length) {
          out.push_back(codec.decode(f.frame.payload()));
        }
      }
    }
  }
  return out;
}

TEST(VehicleBus, SensorsHaveNoiseBiasDelayAndResolution) {
  const auto mean = [](const std::vector<double>& v) {
    double sum = 0.0;
    for (const double x : v) sum += x;
    return sum / static_cast<double>(v.size());
  };
  const auto right = frames(scenario("coast-overdrive"), 1, 8.0);
  const auto biased = frames(scenario("coast-overdrive", {"sensors.torque_bias_Nm=2"}), 1, 8.0);
  EXPECT_NEAR(mean(values(biased, "ECU_Engine", "EngineTorque")) -
                  mean(values(right, "ECU_Engine", "EngineTorque")),
              2.0, 0.01);
  const auto coarse =
      frames(scenario("coast-overdrive", {"sensors.pressure_resolution_Pa=40e3"}), 1, 8.0);
  for (const double bar : values(coarse, "TCU_Pressure", "SecondaryPressure")) {
    ASSERT_NEAR(std::remainder(bar, 0.4), 0.0, 1e-9);
  }
}

TEST(VehicleBus, FaultsActOnTheirSignalAndTimeOnly) {
  const auto right = frames(scenario("coast-overdrive"), 1, 6.0);
  const auto wrong =
      frames(scenario("coast-overdrive",
                      {"fault=[{kind=\"signal_frozen\",channel=\"PrimarySpeed\",at_s=4,for_s=1}]"}),
             1, 6.0);
  const auto a = values(right, "TCU_Speed", "PrimarySpeed");
  const auto b = values(wrong, "TCU_Speed", "PrimarySpeed");
  ASSERT_EQ(a.size(), b.size());
  int equal = 0, frozen = 0;
  for (std::size_t i = 1; i < a.size(); ++i) {
    equal += a[i] == b[i] ? 1 : 0;
    frozen += b[i] == b[i - 1] && a[i] != b[i] ? 1 : 0;
  }
  EXPECT_NEAR(frozen, 100, 3);
  EXPECT_GE(equal + frozen + 3, static_cast<int>(a.size()) - 1);
  EXPECT_EQ(values(right, "TCU_Speed", "SecondarySpeed"),
            values(wrong, "TCU_Speed", "SecondarySpeed"));
  const auto silent = frames(
      scenario("coast-overdrive", {"fault=[{kind=\"frame_silent\",channel=\"TCU_Speed\",at_s=4,"
                                   "for_s=1}]"}),
      1, 6.0);
  EXPECT_NEAR(static_cast<double>(right.size() - silent.size()), 100.0, 1.0);
}

TEST(VehicleSimulation, AStateThatIsNoNumberIsNoticed) {
  VehicleScenario s = scenario("coast-overdrive");
  s.faults.push_back(
      {FaultKind::kTorqueStep, "", 2.0, false, 1.0, std::numeric_limits<double>::infinity()});
  VehiclePort port(s, 1);
  EXPECT_TRUE(port.finite());
  while (port.wait_until(port.now() + 5 * daemon::kMillisecond) != daemon::Wake::kClosed) {
    std::array<daemon::RxFrame, 16> batch;
    port.receive(batch);
  }
  EXPECT_FALSE(port.finite());
  EXPECT_NEAR(seconds(port.vehicle()), 2.0, 0.01);
}

}  // namespace
}  // namespace beltgrip::sim
