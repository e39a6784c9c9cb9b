// Why no experiment begins and what is wrong, at this sample: each inhibit and fault with its
// figure beside its limit, for the journal, `status`, `monitor` and `replay`. Allocates: not on the
// real-time thread.
#pragma once

#include <array>
#include <string>
#include <string_view>

#include "daemon/core/config/options/config.h"
#include "daemon/core/loop/pipeline.h"
#include "daemon/core/observe/event.h"
#include "daemon/core/reasons/reasons.h"

namespace beltgrip::daemon {

using Signals = std::array<SignalObservation, kRoleCount>;
Signals signals_of(const Pipeline& pipeline);

// Empty where the inputs tell none.
std::string figure_of(Inhibit inhibit, const Config& config, const SampleReport& report,
                      const Signals& signals);
std::string figure_of(Fault fault, const SampleReport& report, const Signals& signals);

std::string figure_of(const Event& event, const Config& config, const SampleReport& report,
                      const Signals& signals);

// Each that stands, in their order.
void each_inhibit(const Config& config, const SampleReport& report, const Signals& signals,
                  auto&& take) {
  for (const Named<Inhibit>& each : kInhibits) {
    if ((report.inhibits & inhibit_bit(each.value)) == 0) continue;
    take(reason_of(each.value, figure_of(each.value, config, report, signals)));
  }
}
void each_fault(const SampleReport& report, const Signals& signals, auto&& take) {
  for (const Named<Fault>& each : kFaults) {
    if ((report.faults & fault_bit(each.value)) == 0) continue;
    take(reason_of(each.value, figure_of(each.value, report, signals)));
  }
}

}  // namespace beltgrip::daemon
