// That the second car notices what it is there to notice: its account each broken promise alone,
// its belt a force that is too low, its controller the frames that it must not obey.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/system/vcan/other_vehicle/account.h"
#include "tests/system/vcan/other_vehicle/car.h"
#include "tests/system/vcan/other_vehicle/controller.h"

namespace beltgrip::other {
namespace {

constexpr double kShaft_rad_s = 300.0;
constexpr double kPresent_N = 3400.0;

Bytes clamp_frame(unsigned counter, double force_N) {
  const auto raw = static_cast<unsigned>(force_N);
  Bytes frame{0,
              static_cast<std::uint8_t>(counter),
              static_cast<std::uint8_t>(raw > 0 ? 1 : 0),
              static_cast<std::uint8_t>(raw & 0xFFU),
              static_cast<std::uint8_t>(raw >> 8),
              0,
              0,
              0};
  frame[0] = protection(kEstimateDataId + 2, frame);
  return frame;
}

// A daemon of this file's own: a request that keeps all promises, but for what a test changes.
class Teller {
 public:
  void idle(int frames = 5) {
    for (int i = 0; i < frames; ++i) say(0.0);
  }
  void say(double force_N) { say_raw(clamp_frame(counter_, force_N)); }
  void say_raw(const Bytes& frame) {
    Belt belt;
    belt.clamp_N = present_N;
    account.frame(t_s, kClampId, frame, belt, kShaft_rad_s);
    counter_ = (counter_ + 1) % 15;
    t_s += 0.010;
  }
  void stop_flag() {
    Bytes frame{0, slip_counter_++, 0, 0, 0, 0, 0, 0};
    frame[1] = static_cast<std::uint8_t>(frame[1] | 0x10U);
    frame[0] = protection(kEstimateDataId + 1, frame);
    account.frame(t_s, kSlipId, frame, {}, kShaft_rad_s);
  }
  std::string only_breach() const {
    const std::vector<std::string>& all = account.breaches();
    return all.size() == 1 ? all[0].substr(all[0].find(": ") + 2) : std::to_string(all.size());
  }

  Account account;
  double t_s = 0.0;
  double present_N = kPresent_N;

 private:
  unsigned counter_ = 0;
  std::uint8_t slip_counter_ = 0;
};

TEST(OwnAccount, ARequestThatKeepsItsPromises) {
  Teller daemon;
  daemon.idle();
  for (int i = 0; i < 100; ++i) daemon.say(kPresent_N - 6.0 * i);
  daemon.idle();
  daemon.t_s += kPause_s;
  daemon.say(kPresent_N);
  EXPECT_EQ(daemon.account.breaches(), std::vector<std::string>{});
  EXPECT_EQ(daemon.account.requests().size(), 2U);
}

TEST(OwnAccount, EachBrokenPromiseAlone) {
  const auto after_begin = [](const std::function<void(Teller&)>& what) {
    Teller daemon;
    daemon.idle();
    daemon.say(kPresent_N);
    what(daemon);
    return daemon.only_breach();
  };
  EXPECT_EQ(after_begin([](Teller& d) { d.say(kPresent_N + 2.0); }), "the force asked for rises");
  EXPECT_EQ(after_begin([](Teller& d) { d.say(kPresent_N - 9.0); }),
            "the force asked for falls too fast");
  EXPECT_EQ(after_begin([](Teller& d) {
              d.idle();
              d.say(kPresent_N);
            }),
            "no pause after the last request");
  EXPECT_EQ(after_begin([](Teller& d) {
              d.idle(4);
              d.t_s += kPause_s;
              d.say(kPresent_N);
            }),
            "fewer than five inactive frames before it");
  EXPECT_EQ(after_begin([](Teller& d) {
              d.idle();
              d.t_s += kPause_s;
              d.say(kPresent_N - 200.0);
            }),
            "begins at another force than the present one");
  EXPECT_EQ(after_begin([](Teller& d) {
              d.t_s += 0.050;
              d.say(kPresent_N);
            }),
            "asks on after a silence");
  EXPECT_EQ(after_begin([](Teller& d) {
              for (int i = 0; i < 1501; ++i) d.say(kPresent_N);
            }),
            "the request is too long");
  EXPECT_EQ(after_begin([](Teller& d) {
              d.stop_flag();
              for (int i = 0; i < 5; ++i) d.say(kPresent_N);
            }),
            "asks on after MacroSlipStop");
  EXPECT_EQ(after_begin([](Teller& d) {
              Bytes frame = clamp_frame(6, kPresent_N);
              frame[0] ^= 0x01U;
              d.say_raw(frame);
            }),
            "wrong CRC or length");
  EXPECT_EQ(after_begin([](Teller& d) { d.say_raw(clamp_frame(5, kPresent_N)); }), "wrong counter");
  EXPECT_EQ(after_begin([](Teller& d) {
              Bytes frame = clamp_frame(6, kPresent_N);
              frame[6] = 1;
              frame[0] = protection(kEstimateDataId + 2, frame);
              d.say_raw(frame);
            }),
            "reserved bits");
  EXPECT_EQ(after_begin([](Teller& d) {
              Bytes frame = clamp_frame(6, kPresent_N);
              frame[2] = 0;
              frame[0] = protection(kEstimateDataId + 2, frame);
              d.say_raw(frame);
            }),
            "force and RequestActive disagree");
  Teller low;
  low.present_N = clamp_N(kFloor_Pa, kShaft_rad_s) - 20.0;
  low.idle();
  low.say(low.present_N);
  EXPECT_EQ(low.only_breach(), "the force asked for is below the floor");
}

// In balance the belt carries what the engine gives: mu = T cos(angle) / (2 R F), by hand.
TEST(OwnCar, CarriesTheTorqueInBalance) {
  constexpr double kForce_N = 3000.0;
  Car car(kDragTorque_Nm, kForce_N, 1.0);
  for (int i = 0; i < 1000; ++i) car.step();
  const double wedge = std::cos(kHalfWedge_deg * std::numbers::pi / 180.0);
  const double needed = kDragTorque_Nm * wedge / (2.0 * kPrimaryRadius_m * kForce_N);
  EXPECT_NEAR(traction(car.belt().slip_percent), needed, 2e-4);
  EXPECT_NEAR(car.belt().clamp_N, kForce_N, 5.0);
}

// A twentieth below what the peak carries: no promise of slip would be kept.
TEST(OwnCar, SlipsThroughWhereTheForceIsTooLow) {
  const double wedge = std::cos(kHalfWedge_deg * std::numbers::pi / 180.0);
  const double carries_N =
      std::abs(kDragTorque_Nm) * wedge / (2.0 * kPrimaryRadius_m * peak_traction());
  for (const double share : {1.05, 0.95}) {
    Car car(kDragTorque_Nm, 3400.0, 1.0);
    Teller daemon;
    daemon.idle();
    daemon.say(kPresent_N);
    car.clamp_command_N = share * carries_N;
    for (int i = 0; i < 6000; ++i) {
      car.step();
      daemon.account.step(car.belt());
    }
    const Harm& harm = daemon.account.requests()[0].harm;
    EXPECT_EQ(harm.slip_percent > 10.0, share < 1.0) << harm.slip_percent;
    EXPECT_EQ(harm.beyond_peak_J > 100.0, share < 1.0) << harm.beyond_peak_J;
  }
}

class OwnController : public testing::Test {
 protected:
  OwnController() { controller_.judge_torque(0.0, kDragTorque_Nm, kDragTorque_Nm); }
  void hear(double force_N, unsigned step = 1) {
    t_s_ += 0.010;
    counter_ = (counter_ + step) % 15;
    controller_.hear(t_s_, clamp_frame(counter_, force_N));
  }
  bool obeys() {
    controller_.command_N(t_s_, kShaft_rad_s);
    return controller_.obeys_now();
  }

  Controller controller_;
  double t_s_ = 10.0;
  unsigned counter_ = 0;
};

TEST_F(OwnController, ObeysOnlyAfterAnInactiveFrame) {
  hear(3000.0);
  EXPECT_FALSE(obeys());
  hear(0.0);
  hear(3000.0);
  EXPECT_TRUE(obeys());
  hear(0.0);
  EXPECT_FALSE(obeys());
  hear(3000.0);
  EXPECT_FALSE(obeys()) << "within a second of the last";
}

TEST_F(OwnController, TakesItsForceBack) {
  hear(0.0);
  hear(3000.0);
  hear(2990.0, 4);
  t_s_ += 0.045;
  EXPECT_FALSE(obeys()) << "a counter that jumps keeps nothing alive";
  t_s_ += 2.0;
  hear(0.0);
  hear(3000.0);
  EXPECT_TRUE(obeys());
  controller_.permits = false;
  EXPECT_FALSE(obeys());
  controller_.permits = true;
  EXPECT_FALSE(obeys()) << "the request is over";
  t_s_ += 2.0;
  hear(0.0);
  hear(3000.0);
  EXPECT_TRUE(obeys());
  controller_.judge_torque(t_s_, 60.0, kDragTorque_Nm);
  EXPECT_FALSE(obeys()) << "more torque asked for than when it began";
}

}  // namespace
}  // namespace beltgrip::other
