// The second car (tests/system/vcan/other_vehicle) beside the pipeline in virtual time: controllers
// and drivers that are not as the daemon is told, by many drives each.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <string_view>

#include "tests/system/vcan/other_vehicle/virtual_drive.h"

namespace beltgrip::other {
namespace {

using daemon::ExperimentResult;
using estimator::StopReason;

// What is promised: daemon/CLAMP_CONTRACT.md, "What the daemon promises".
constexpr double kSlip_percent = 10.0, kSlip_m_s = 0.8, kBeyondPeak_J = 100.0;
constexpr unsigned kValue = 1;
constexpr double kDrive_Nm = 45.0;

void expect_no_harm(const Account& account) {
  for (const Request& request : account.requests()) {
    EXPECT_LT(request.harm.slip_percent, kSlip_percent);
    EXPECT_LT(request.harm.slip_m_s, kSlip_m_s);
    EXPECT_LT(request.harm.beyond_peak_J, kBeyondPeak_J);
  }
  EXPECT_EQ(account.breaches(), std::vector<std::string>{});
}

double count(const std::vector<ExperimentResult>& all, StopReason reason) {
  return static_cast<double>(std::ranges::count(all, reason, &ExperimentResult::stop_reason));
}

// How a pressure is read: kPa and s.
struct Pressure {
  std::string_view name;
  double noise_kPa = 3.0, step_kPa = 0.2, offset_kPa = 0.0, period_s = 0.010;
};
const std::array kPressures{
    Pressure{"as it is"}, Pressure{"quiet, every 20 ms", 1.0, 1.0, 0.0, 0.02},
    Pressure{"in steps of a tenth of a bar", 3.0, 10.0}, Pressure{"too much", 3.0, 0.2, 8.0},
    Pressure{"too little", 3.0, 0.2, -8.0}};

void read(Ride& car, const Pressure& pressure) {
  car.pressure_noise_kPa = pressure.noise_kPa;
  car.pressure_step_kPa = pressure.step_kPa;
  car.pressure_offset_kPa = pressure.offset_kPa;
  car.pressure_period_s = pressure.period_s;
}

constexpr std::size_t kDrives = 6;

// Two requests each. BeltGrip is told 0.15 s, and the car's own are 0.14 s.
std::vector<ExperimentResult> experiments_with(double late_s, const Pressure& pressure,
                                               double torque_Nm) {
  std::vector<ExperimentResult> all;
  for (std::size_t seed = 1; seed <= kDrives; ++seed) {
    SCOPED_TRACE(seed);
    VirtualDrive car({torque_Nm, 1.0}, seed);
    read(car, pressure);
    car.car().late_s = late_s;
    car.until([&] { return car.experiments().size() >= 2; }, 30.0);
    car.drive_on(1.0);
    expect_no_harm(car.account());
    all.insert(all.end(), car.experiments().begin(), car.experiments().end());
  }
  EXPECT_EQ(all.size(), 2 * kDrives);
  return all;
}

TEST(OtherController, OneThatObeysAsConfiguredIsNotTakenForLate) {
  for (const Pressure& pressure : kPressures) {
    for (const double torque_Nm : {kDragTorque_Nm, kDrive_Nm}) {
      SCOPED_TRACE(pressure.name);
      const auto all = experiments_with(0.0, pressure, torque_Nm);
      // Measured: of 96 requests 0, of those whose force is read otherwise than the controller
      // reckons it, or in steps, 2 of 288.
      EXPECT_LE(count(all, StopReason::kLag), 1) << torque_Nm;
      // The others come to the top; whether they bring a value or a bound is the estimator's
      // matter.
      EXPECT_GE(count(all, StopReason::kSlope) + count(all, StopReason::kSlipRate) +
                    count(all, StopReason::kSlipEnergy),
                10)
          << torque_Nm;
    }
  }
}

// 2.3 times what is configured, to 5 times: never once is the belt brought near its peak.
TEST(OtherController, OneThatObeysLaterIsNoticedBeforeThePeak) {
  for (const Pressure& pressure : kPressures) {
    for (const double torque_Nm : {kDragTorque_Nm, kDrive_Nm}) {
      for (const double late_s : {0.20, 0.25, 0.30, 0.35, 0.60}) {
        SCOPED_TRACE(std::string(pressure.name) + ", " + std::to_string(late_s));
        const auto all = experiments_with(late_s, pressure, torque_Nm);
        EXPECT_EQ(count(all, StopReason::kLag) + count(all, StopReason::kClampNotFollowed),
                  2 * kDrives)
            << torque_Nm;
        for (const ExperimentResult& each : all) EXPECT_LT(each.sigma_stop_percent, 1.6);
      }
    }
  }
}

// A driver who steps on the pedal while the belt is driven: the request ends in the first sample
// that knows it, a sample and a frame later at the most, and says nothing of the belt.
TEST(OtherController, ADriverWhoStepsOnThePedalEndsTheRequest) {
  constexpr double kAtOnce_s = 0.010;
  for (const double step_percent : {5.0, 8.0, 10.0, 15.0, 20.0}) {
    for (const double slip_percent : {1.0, 1.8, 2.4}) {
      for (std::size_t seed = 1; seed <= kDrives; ++seed) {
        SCOPED_TRACE(testing::Message() << step_percent << " at " << slip_percent << ", " << seed);
        VirtualDrive car({kDrive_Nm, 1.0}, seed);
        ASSERT_TRUE(car.until(
            [&] { return car.account().request_stands() && car.slip_percent() > slip_percent; },
            40.0));
        const double from_s = car.t_s();
        const std::size_t results = car.account().results().size();
        const std::size_t ended = car.experiments().size();
        car.pedal_percent += step_percent;
        car.drive_on(1.4);
        EXPECT_LT(car.account().requests().back().last_active_s, from_s + kAtOnce_s);
        EXPECT_EQ(car.account().results().size(), results);
        ASSERT_EQ(car.experiments().size(), ended + 1);
        EXPECT_EQ(car.experiments().back().stop_reason, StopReason::kDriver);
        EXPECT_EQ(car.experiments().back().outcome, daemon::Outcome::kAborted);
        expect_no_harm(car.account());
      }
    }
  }
}

// So little that only the torque shows it. What is told of the belt then is right all the same.
TEST(OtherController, WhatIsToldOfABeltWhoseTorqueMovesIsRight) {
  for (const double step_percent : {-2.5, 1.5, 2.0, 2.5}) {
    for (const double slip_percent : {1.0, 1.4, 1.8, 2.1, 2.4}) {
      for (std::size_t seed = 1; seed <= kDrives; ++seed) {
        SCOPED_TRACE(testing::Message() << step_percent << " at " << slip_percent << ", " << seed);
        VirtualDrive car({kDrive_Nm, 1.0}, seed);
        ASSERT_TRUE(car.until(
            [&] { return car.account().request_stands() && car.slip_percent() > slip_percent; },
            40.0));
        car.pedal_percent += step_percent;
        car.drive_on(1.4);
        for (const Result& each : car.account().results()) {
          if (each.kind == kValue) {
            EXPECT_NEAR(each.mu_max, car.mu_max(), 3.0 * each.std);
          } else {
            EXPECT_LT(each.mu_max, car.mu_max());
          }
        }
        expect_no_harm(car.account());
      }
    }
  }
}

// A controller whose force stays this much below its own after a request that was cut short.
std::unique_ptr<VirtualDrive> after_a_request(double stays_share, double torque_Nm,
                                              std::size_t seed) {
  auto car = std::make_unique<VirtualDrive>(Kind{torque_Nm, 1.0}, seed);
  EXPECT_TRUE(car->until(
      [&] { return car->account().request_stands() && car->slip_percent() > 1.2; }, 40.0));
  car->controller().stays_share = stays_share;
  car->refuses = true;
  car->drive_on(0.3);
  car->refuses = false;
  return car;
}

constexpr int kFaultClampStuck = 43;

TEST(OtherController, OneThatKeepsAPartOfItsForceIsNotAskedAgain) {
  for (const double torque_Nm : {kDragTorque_Nm, kDrive_Nm}) {
    for (const double stays_share : {0.93, 0.90, 0.85, 0.81, 0.70}) {
      for (std::size_t seed = 1; seed <= kDrives; ++seed) {
        SCOPED_TRACE(testing::Message() << torque_Nm << ", " << stays_share << ", " << seed);
        const auto car = after_a_request(stays_share, torque_Nm, seed);
        const std::size_t requests = car->account().requests().size();
        car->drive_on(12.0);
        EXPECT_EQ(car->account().requests().size(), requests);
        EXPECT_TRUE(car->account().fault_seen(kFaultClampStuck));
        EXPECT_EQ(car->state(), daemon::State::kFault);
        expect_no_harm(car->account());
      }
    }
  }
}

// And is asked once it has come back; unless it had stayed at what was asked.
TEST(OtherController, OneThatGivesItsForceBackIsAskedAgain) {
  for (const double torque_Nm : {kDragTorque_Nm, kDrive_Nm}) {
    for (std::size_t seed = 1; seed <= kDrives; ++seed) {
      SCOPED_TRACE(testing::Message() << torque_Nm << ", " << seed);
      const auto car = after_a_request(0.90, torque_Nm, seed);
      car->drive_on(5.0);
      const std::size_t requests = car->account().requests().size();
      car->controller().stays_share = 1.0;
      EXPECT_TRUE(car->until([&] { return car->account().requests().size() > requests; }, 20.0));
    }
  }
}

}  // namespace
}  // namespace beltgrip::other
