#include "tests/system/vcan/other_vehicle/account.h"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace beltgrip::other {
namespace {

constexpr unsigned kCounters = 15;
constexpr int kIdleFrames = 5;
constexpr double kLongest_s = 15.0;
constexpr double kPeriod_s = 0.010;
constexpr double kSilence_s = 0.050;  // for a controller the request is over
// Chosen: an active frame after the stop flag may have been on its way.
constexpr double kAfterStop_s = 0.030;
// The first force is the present one: three times the noise of this car's pressure (3 kPa, 32 N),
// which the daemon has smoothed, and 1 % for what the sensor may be off by.
constexpr double kBegin_N = 100.0, kBeginShare = 0.01;
constexpr double kResolution_N = 1.0;

double passed(const Belt& belt) { return std::abs(belt.slip_percent); }

void add(Harm& harm, const Belt& belt) {
  static const double peak = peak_slip_percent();
  harm.slip_percent = std::max(harm.slip_percent, passed(belt));
  harm.slip_m_s = std::max(harm.slip_m_s, std::abs(belt.slip_m_s));
  if (passed(belt) > peak) {
    harm.beyond_peak_J += std::abs(belt.force_N * belt.slip_m_s) * Car::kStep_s;
  }
}

}  // namespace

void Account::breach(double t_s, const std::string& what) {
  std::ostringstream line;
  line.precision(4);
  line << "at " << t_s << " s: " << what;
  breaches_.push_back(line.str());
}

void Account::another_daemon() {
  counters_.clear();
  stands_ = false;
  idle_frames_ = 0;
  stop_flag_s_.reset();
  experiment_count_ = 0;
}

void Account::step(const Belt& belt) {
  add(whole_, belt);
  if (requests_.empty()) return;
  Request& request = requests_.back();
  add(request.harm, belt);
  if (!stands_) return;
  request.given_least_N = std::min(request.given_least_N, belt.clamp_N);
  request.most_above_N = std::max(request.most_above_N, belt.clamp_N - request.last_N);
  request.most_below_N = std::max(request.most_below_N, request.last_N - belt.clamp_N);
}

bool Account::protected_right(double t_s, canid_t id, const Bytes& frame) {
  const auto data_id = static_cast<std::uint16_t>(kEstimateDataId + (id - kEstimateId));
  if (frame.size() != 8 || protection(data_id, frame) != frame[0]) {
    breach(t_s, "wrong CRC or length");
    return false;
  }
  const auto counter = static_cast<unsigned>(bits(frame, 8, 4));
  const auto last = counters_.find(id);
  if (counter >= kCounters ||
      (last != counters_.end() && counter != (last->second + 1) % kCounters)) {
    breach(t_s, "wrong counter");
  }
  counters_[id] = counter;
  return true;
}

void Account::frame(double t_s, canid_t id, const Bytes& frame, const Belt& belt,
                    double secondary_rad_s) {
  if (id < kEstimateId || id > kStatusId) {
    breach(t_s, "a frame that nobody asked for");
    return;
  }
  if (!protected_right(t_s, id, frame)) return;
  if (id == kEstimateId) estimate(t_s, frame);
  if (id == kSlipId) slip(t_s, frame);
  if (id == kClampId) clamp(t_s, frame, belt, secondary_rad_s);
  if (id == kStatusId) {
    status_ = {static_cast<unsigned>(bits(frame, 12, 4)), static_cast<unsigned>(bits(frame, 16, 2)),
               static_cast<unsigned>(bits(frame, 18, 5)), bits(frame, 24, 20)};
    reasons_ |= std::uint64_t{1} << status_.stop_reason;
    faults_ |= status_.faults;
  }
}

void Account::clamp(double t_s, const Bytes& frame, const Belt& belt, double secondary_rad_s) {
  const bool asks = bits(frame, 16, 1) != 0;
  const auto force_N = static_cast<double>(bits(frame, 24, 16));
  if (bits(frame, 12, 4) != 0 || bits(frame, 17, 7) != 0 || bits(frame, 40, 24) != 0) {
    breach(t_s, "reserved bits");
  }
  if (asks != (force_N > 0.0)) breach(t_s, "force and RequestActive disagree");
  if (asks) {
    active(t_s, force_N, belt, secondary_rad_s);
  } else {
    stands_ = false;
    ++idle_frames_;
  }
}

void Account::active(double t_s, double force_N, const Belt& belt, double secondary_rad_s) {
  if (!stands_) {
    if (idle_frames_ < kIdleFrames) breach(t_s, "fewer than five inactive frames before it");
    if (!requests_.empty() && t_s < requests_.back().last_active_s + kPause_s) {
      breach(t_s, "no pause after the last request");
    }
    if (std::abs(force_N - belt.clamp_N) > kBegin_N + kBeginShare * belt.clamp_N) {
      breach(t_s, "begins at another force than the present one");
    }
    Request request;
    request.begin_s = t_s;
    request.first_N = force_N;
    request.given_at_begin_N = belt.clamp_N;
    requests_.push_back(request);
  } else {
    const Request& before = requests_.back();
    // As asked for at the rate of the frames, or late.
    const double dt_s = std::max(kPeriod_s, t_s - before.last_active_s);
    if (force_N > before.last_N) breach(t_s, "the force asked for rises");
    if (before.last_N - force_N > kRateMax_N_per_s * dt_s + kResolution_N) {
      breach(t_s, "the force asked for falls too fast");
    }
    if (t_s > before.last_active_s + kSilence_s) breach(t_s, "asks on after a silence");
    if (t_s > before.begin_s + kLongest_s) breach(t_s, "the request is too long");
    if (stop_flag_s_ && t_s > *stop_flag_s_ + kAfterStop_s) {
      breach(t_s, "asks on after MacroSlipStop");
    }
  }
  if (force_N + kResolution_N < clamp_N(kFloor_Pa, secondary_rad_s)) {
    breach(t_s, "the force asked for is below the floor");
  }
  Request& request = requests_.back();
  request.last_N = force_N;
  request.last_active_s = t_s;
  ++request.frames;
  stands_ = true;
  idle_frames_ = 0;
}

void Account::slip(double t_s, const Bytes& frame) {
  const bool stop = bits(frame, 12, 1) != 0;
  if (!stop && stop_flag_s_ && stands_) breach(t_s, "MacroSlipStop falls while a request stands");
  if (!stop) stop_flag_s_.reset();
  if (stop && !stop_flag_s_) stop_flag_s_ = t_s;
}

void Account::estimate(double t_s, const Bytes& frame) {
  const auto count = static_cast<unsigned>(bits(frame, 43, 8));
  const bool valid = bits(frame, 14, 1) != 0;
  Result result{t_s, static_cast<unsigned>(bits(frame, 12, 2)),
                static_cast<double>(bits(frame, 16, 15)) * 1e-5,
                static_cast<double>(bits(frame, 31, 12)) * 2e-5};
  if (valid != (result.kind == 1)) breach(t_s, "MuMaxValid without a value");
  if (count == experiment_count_) return;
  experiment_count_ = count;
  results_.push_back(result);
}

std::string Account::text(double mu_max) const {
  std::ostringstream text;
  text.precision(3);
  for (const Request& r : requests_) {
    text << "request at " << r.begin_s << " s: " << r.last_active_s - r.begin_s << " s, "
         << r.frames << " frames, asked " << std::lround(r.first_N) << " to "
         << std::lround(r.last_N) << " N, given " << std::lround(r.given_at_begin_N) << " to "
         << std::lround(r.given_least_N) << " N (above what was asked by "
         << std::lround(r.most_above_N) << " N, below it by " << std::lround(r.most_below_N)
         << " N at most); " << r.harm.slip_percent << " % slip, " << r.harm.slip_m_s << " m/s, "
         << r.harm.beyond_peak_J << " J beyond the peak\n";
  }
  for (const Result& r : results_) {
    text << "result at " << r.t_s << " s: "
         << (r.kind == 1   ? "value "
             : r.kind == 2 ? "lower bound "
                           : "nothing ")
         << r.mu_max << ", std " << r.std << "; truth " << mu_max << "\n";
  }
  text << "whole drive: " << whole_.slip_percent << " % slip, " << whole_.slip_m_s << " m/s, "
       << whole_.beyond_peak_J << " J beyond the peak; state " << status_.state << ", outcome "
       << status_.outcome << ", stop reason " << status_.stop_reason << ", faults " << std::hex
       << faults_ << std::dec << "\n";
  for (const std::string& each : breaches_) text << "BROKEN " << each << "\n";
  return text.str();
}

}  // namespace beltgrip::other
