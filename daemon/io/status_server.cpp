#include "daemon/io/status_server.h"

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <nlohmann/json.hpp>

#include "can_dbc/text/unit_text.h"
#include "daemon/core/base/named.h"
#include "daemon/core/experiment/arming.h"
#include "daemon/core/observe/reasons_now.h"
#include "daemon/core/publish/names.h"
#include "daemon/io/carried_keeper.h"

namespace beltgrip::daemon {

using estimator::ReadingVerdict;

namespace {

using Json = nlohmann::ordered_json;  // NaN and infinity become null

constexpr int kWaitingMost = 8;

Json latency(const LatencyHistogram& histogram) {
  const auto us = [](Duration duration) { return static_cast<double>(duration.ns()) / 1e3; };
  Json classes = Json::array();
  for (std::size_t i = 0; i < LatencyHistogram::kClasses; ++i) {
    if (histogram.count_of(i) == 0) continue;
    classes.push_back({us(histogram.upper_bound(i)), histogram.count_of(i)});
  }
  return {{"count", histogram.count()},
          {"p50_us", us(histogram.quantile(0.5))},
          {"p99_us", us(histogram.quantile(0.99))},
          {"p999_us", us(histogram.quantile(0.999))},
          {"max_us", us(histogram.maximum())},
          {"classes", std::move(classes)}};
}

Json signals(MonoTime now, const Observation& observation) {
  Json all = Json::object();
  for (std::size_t i = 0; i < kRoleCount; ++i) {
    const SignalObservation& seen = observation.signals[i];
    if (seen.status.verdict == ReadingVerdict::kUnbound) continue;
    const auto role = static_cast<Role>(i);
    Json& one = all[std::string(role_name(role))];
    one["quality"] = estimator::verdict_text(seen.status.verdict);
    one["age_s"] = seen.seen ? Json(seconds(now - seen.t)) : Json();
    one["value"] = seen.seen ? Json(seen.value) : Json();
    one["unit"] = can::si_unit_text(role_dimension(role));
    one["since_s"] = seconds(now - MonoTime::of_ns(seen.status.since_ns));  // so long it is so
    one["expected"] = seen.status.expected;
    one["deviation"] = std::sqrt(seen.status.variance);
    one["test_ratio"] = seen.status.test_ratio;
  }
  return all;
}

Json result(MonoTime now, const ExperimentResult& last) {
  if (last.outcome == Outcome::kNone) return {};
  const estimator::PeakEstimate& peak = last.peak;
  const bool value = peak.kind == estimator::PeakKind::kValue;
  const bool bound = peak.kind == estimator::PeakKind::kLowerBound;
  return {{"outcome", outcome_name(last.outcome)},
          {"stop_reason", stop_reason_name(last.stop_reason)},
          {"reason", why(last)},
          {"remedy", remedy_of(last)},
          {"age_s", seconds(now - last.end)},
          {"mu_max", value ? Json(peak.mu_max) : Json()},
          {"mu_max_std", value ? Json(peak.mu_max_std) : Json()},
          {"mu_max_lower_bound", bound ? Json(peak.mu_max) : Json()}};
}

// Null where no role comes from there.
Json diagnostics(const Config& config, const UdsCounters& counters) {
  const bool used = std::any_of(config.roles.begin(), config.roles.end(),
                                [](const RoleBinding& role) { return role.uds.has_value(); });
  if (!used) return {};
  return {{"polls", config.diagnostics == Diagnostics::kPoll},
          {"requests", counters.requests},
          {"answers", counters.answers},
          {"refusals", counters.refusals},
          {"last_refusal", counters.refusals > 0 ? Json(counters.last_code) : Json()},
          {"without_answer", counters.timeouts},
          {"broken", counters.broken},
          {"frames_of_another_tester", counters.foreign}};
}

template <typename Enum, std::size_t kCount>
Json names(std::uint32_t bits, const std::array<Named<Enum>, kCount>& all) {
  Json set = Json::array();
  for (std::size_t i = 0; i < kCount; ++i) {
    if ((bits >> i & 1U) != 0) set.push_back(all[i].name);
  }
  return set;
}

Json reasons(const Config& config, const Observation& observation) {
  Json all = Json::array();
  const auto add = [&all](const char* kind) {
    return [&all, kind](const Reason& each) {
      all.push_back({{"kind", kind},
                     {"name", each.name},
                     {"means", each.means},
                     {"figure", each.figure},
                     {"remedy", each.remedy}});
    };
  };
  each_fault(observation.report, observation.signals, add("fault"));
  each_inhibit(config, observation.report, observation.signals, add("inhibit"));
  return all;
}

}  // namespace

std::string status_json(const Config& config, MonoTime now, const Observation& observation,
                        const CarriedBounds& carried) {
  const SampleReport& report = observation.report;
  const estimator::CurveEstimate& curve = report.curve;
  const bool usable = curve.usable && report.sample.usable;
  const Json status{
      {"interface", config.interface},
      {"control", config.control == Control::kCommand ? "command" : "observe"},
      {"age_s", seconds(now - observation.t)},
      {"state", state_name(report.state)},
      {"phase", phase_name(curve.phase)},
      {"in_experiment", report.in_experiment},
      {"macro_slip_stop", report.macro_slip_stop},
      {"request_force_N", report.request_force_N},
      {"mu_star", usable ? Json(curve.mu_star) : Json()},
      {"sigma_star_percent", usable ? Json(curve.sigma_star_percent) : Json()},
      {"friction_slope", usable ? Json(curve.friction_slope) : Json()},
      {"faults", names(report.faults, kFaults)},
      {"inhibits", names(report.inhibits, kInhibits)},
      {"why", reasons(config, observation)},
      {"result", result(now, report.result)},
      {"carried", carried_json(carried)},
      {"signals", signals(now, observation)},
      {"counters",
       {{"frames", observation.pipeline.frames},
        {"frames_decoded", observation.pipeline.frames_decoded},
        {"frames_bad", observation.pipeline.frames_bad},
        {"frames_refused", observation.pipeline.frames_refused},
        {"samples", observation.pipeline.samples},
        {"samples_late", observation.loop.counters.samples_late},
        {"sends_failed", observation.loop.counters.sends_failed}}},
      {"diagnostics", diagnostics(config, observation.pipeline.diagnostics)},
      {"latency",
       {{"wake_up", latency(observation.loop.wake_up)},
        {"sample_to_frame", latency(observation.loop.sample_to_frame)},
        {"frame_age", latency(observation.loop.frame_age)}}},
  };
  return status.dump() + "\n";
}

StatusServer::StatusServer(const std::string& folder) {
  if (folder.empty()) return;
  path_ = folder + "/status.sock";
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  constexpr mode_t kEverybody = 0666;
  if (path_.size() < sizeof address.sun_path) {
    path_.copy(address.sun_path, path_.size());
    unlink(path_.c_str());  // left by one that was killed
    socket_ = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (socket_ >= 0 && bind(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0 &&
        chmod(path_.c_str(), kEverybody) == 0 && listen(socket_, kWaitingMost) == 0) {
      return;
    }
  } else {
    errno = ENAMETOOLONG;
  }
  error_ = path_ + ": no status to ask for (" + std::strerror(errno) + ")";
  path_.clear();
}

StatusServer::~StatusServer() {
  if (socket_ >= 0) close(socket_);
  if (!path_.empty()) unlink(path_.c_str());
}

void StatusServer::turn(const Config& config, MonoTime now, const Observation* newest,
                        const CarriedBounds& carried) {
  if (socket_ < 0 || newest == nullptr) return;
  for (int answered = 0; answered < kWaitingMost; ++answered) {
    const int peer = accept4(socket_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (peer < 0) return;
    // It fits into the socket's buffer, or the reader gets what fits.
    const std::string text = status_json(config, now, *newest, carried);
    ::send(peer, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    close(peer);
  }
}

}  // namespace beltgrip::daemon
