// The ladder of limits of a clamp request, in one place and in order: the experiment ends itself
// first, then the safety monitor withdraws its permission, then the transmit gate refuses its
// frames, all before what is promised. SI; slip as a fraction.
//
// Not here: the floor of the clamp force, which is the configuration's
// (experiment.secondary_pressure_floor_Pa; made a force in experiment/force_floor).
//
// Who judges keeps its own code; only the numbers are shared. "Origin" says where one comes from:
// promised (the promise G1), measured (tests/FIGURES.md, tests/campaign), chosen (why).
#pragma once

#include <cstdint>

#include "daemon/core/base/mono_time.h"

namespace beltgrip::daemon::limits {

// --- what a belt may go through in a request: promised ------------------------------------------
inline constexpr double kPromisedSlip_share = 0.10;
inline constexpr double kPromisedSlipSpeed_m_s = 0.8;
inline constexpr double kPromisedEnergy_J = 100.0;  // beyond the peak

// What is only observed asks nothing of the belt: no torque is too large, and the shaft may turn
// more slowly. Chosen: at half the speed the rounding of a speed weighs twice as much in the slip,
// which the estimator reads off the data.
inline constexpr double kObservedSpeedShare = 0.5;  // of the least speed at the start

// --- a crossing is reckoned before it is asked for (experiment/reachability) ---------------------
// Of slip beyond the peak, where friction falls as steeply as must be survived. A crossing that
// runs further is so near to not being caught at all that a little less force, friction or inertia
// decides. Measured, with what noise hides: the table in reachability.cpp.
inline constexpr double kCrossingSlipBeyond_share = 0.025;

// --- the request ends itself (experiment/clamp_request) ------------------------------------------
inline constexpr double kRequestSlip_share = 0.07;        // chosen: room to come back, at any speed
inline constexpr double kRequestSlipBeyond_share = 0.02;  // chosen: past where friction was largest
inline constexpr double kRequestSlipRate_1_s = 0.12;      // measured: a belt that runs away
// Chosen: below it noise has such rates.
inline constexpr double kRequestSlipRateFrom_share = 0.0075;
// Beyond the peak, as it is estimated. Adhesive wear begins at a line of load and sliding speed;
// the one hard point is 3 kN, 0.8 m/s, 0.5 kW for seconds (the paper).
// With what is still to come, a silence among it, as the motion has it (experiment/reachability).
// Measured (campaign --seeds 6000 --from 1810001 --nothing-wrong --noise production, 884 requests,
// 441 peaks in reach): 70 J gives 384 values and breaks nothing; 80 J 389, but two belts with level
// tops beyond 6 % of slip take 113 and 105 J, for noise makes such a top look as if it rose. Of the
// 98 peaks from 990001 in lab and production noise 60 J tells 79 and 83, 70 J 86 and 86, 80 J 89
// and 89.
inline constexpr double kRequestEnergy_J = 70.0;
inline constexpr double kRequestPower_W = 400.0;           // chosen: 0.8 of the paper's point
inline constexpr double kRequestFast_m_s = 0.4;            // chosen: half of what is promised
inline constexpr double kRequestFast_s = 0.6;              // chosen, above it
inline constexpr Duration kRequestLongest = 15 * kSecond;  // chosen: the controller's patience
inline constexpr double kRequestSpeedShare = 0.93;         // of the least speed at the start
// Chosen: five frames make a lost one harmless, and a controller that has just come up hears them.
inline constexpr int kInactiveFrames = 5;
inline constexpr Duration kClampPeriod = 10 * kMillisecond;
inline constexpr Duration kAnnounced = kInactiveFrames * kClampPeriod;

// --- the safety monitor withdraws the permission (guard/safety_monitor) --------------------------
// It cannot know where the peak lies: slip and power of any kind.
inline constexpr double kMonitorSlipDebounced_share = 0.075;
inline constexpr double kMonitorSlip_share = 0.09;
inline constexpr double kMonitorSlipSpeed_m_s = 0.70;
inline constexpr double kMonitorSlipRate_1_s = 0.15;  // chosen: beyond the request's own
inline constexpr double kMonitorPower_W = 250.0;      // chosen
inline constexpr Duration kMonitorPowerFor = 600 * kMillisecond;
inline constexpr Duration kMonitorLongest = kRequestLongest;
inline constexpr double kMonitorSpeedShare = 0.85;  // of the least speed at the start
// Of the force that acts, where a request begins. Chosen: beside the noise of the pressure (3 % of
// the force as each reads it), and above what a belt held with the usual reserve of 1.3 needs.
inline constexpr double kMonitorStartShare = 0.87;

// --- the gate refuses the frame (guard/tx_gate) --------------------------------------------------
// Chosen: the longest request, and the last frames of a loop that is late.
inline constexpr std::uint32_t kGateFrames =
    static_cast<std::uint32_t>(kRequestLongest / kClampPeriod) + 10;
// Chosen: a frame every 10 ms, one sample late at most.
inline constexpr double kGateFramePeriod_s = 0.016;

inline constexpr double kGateStartShare = 0.80;  // chosen: below the monitor's, above 1 / 1.3

static_assert(kRequestSlip_share < kMonitorSlipDebounced_share &&
              kMonitorSlipDebounced_share < kMonitorSlip_share &&
              kMonitorSlip_share < kPromisedSlip_share);
static_assert(kRequestSlipRateFrom_share < kRequestSlip_share &&
              kRequestSlipBeyond_share < kRequestSlip_share);
static_assert(kRequestSlipBeyond_share < kCrossingSlipBeyond_share &&
              kCrossingSlipBeyond_share < kPromisedSlip_share);
static_assert(kRequestSlipRate_1_s < kMonitorSlipRate_1_s);
static_assert(kRequestFast_m_s < kMonitorSlipSpeed_m_s);
static_assert(kMonitorSlipSpeed_m_s < kPromisedSlipSpeed_m_s);
static_assert(kRequestEnergy_J < kPromisedEnergy_J);
static_assert(kRequestLongest <= kMonitorLongest && kMonitorLongest < kGateFrames * kClampPeriod);
static_assert(kGateStartShare < kMonitorStartShare && kMonitorStartShare < 1.0);
static_assert(kMonitorSpeedShare < kRequestSpeedShare && kRequestSpeedShare < 1.0);
static_assert(seconds(kClampPeriod) < kGateFramePeriod_s);

}  // namespace beltgrip::daemon::limits
