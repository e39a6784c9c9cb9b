#include "daemon/io/service_notify.h"

#include <systemd/sd-daemon.h>

#include "can_dbc/text/number_text.h"
#include "daemon/core/observe/event.h"
#include "daemon/core/publish/names.h"

namespace beltgrip::daemon {

namespace {

// Room for three missed turns before the service manager loses patience.
constexpr int kFeedsPerPeriod = 4;

}  // namespace

std::string status_line(const Observation& observation) {
  const SampleReport& report = observation.report;
  std::string line(state_name(report.state));
  const estimator::PeakEstimate& peak = report.result.peak;
  if (peak.kind == estimator::PeakKind::kValue) {
    line += ", mu_max " + fixed_text(peak.mu_max, 4) + " +- " + fixed_text(peak.mu_max_std, 4);
  } else if (peak.kind == estimator::PeakKind::kLowerBound) {
    line += ", mu_max above " + fixed_text(peak.mu_max, 4);
  } else {
    line += ", no result yet";
  }
  std::string faults;
  for (std::size_t i = 0; i < kFaultCount; ++i) {
    if ((report.faults >> i & 1U) == 0) continue;
    faults += (faults.empty() ? ", faults " : " ") + std::string(kFaults[i].name);
  }
  return line + faults;
}

ServiceNotify::ServiceNotify() {
  std::uint64_t period_us = 0;
  if (sd_watchdog_enabled(0, &period_us) > 0) {
    feed_period_ = period_us * kMicrosecond / kFeedsPerPeriod;
  }
}

void ServiceNotify::turn(MonoTime now, const Observation* newest) {
  if (newest == nullptr || newest->pipeline.samples == 0) return;
  std::string message;
  if (!ready_) message += "READY=1\n";
  ready_ = true;
  if (std::string status = status_line(*newest); status != status_) {
    status_ = std::move(status);
    message += "STATUS=" + status_ + "\n";
  }
  // Only a loop that has moved on since the last time is worth a feed.
  if (feed_period_ != Duration{} && now >= feed_at_ && newest->pipeline.samples != samples_fed_) {
    samples_fed_ = newest->pipeline.samples;
    feed_at_ = now + feed_period_;
    message += "WATCHDOG=1\n";
  }
  if (!message.empty()) sd_notify(0, message.c_str());
}

void ServiceNotify::reloading(MonoTime now) {
  const std::string message =
      "RELOADING=1\nMONOTONIC_USEC=" + std::to_string(now.since_origin() / kMicrosecond);
  sd_notify(0, message.c_str());
}

void ServiceNotify::reloaded() { sd_notify(0, "READY=1"); }

void ServiceNotify::stopping() { sd_notify(0, "STOPPING=1\nSTATUS=stopping"); }

}  // namespace beltgrip::daemon
