// A CAN log as a table of measured signals: the configuration's roles, SI, each channel with the
// stamps of its own frames. Frames and values are taken by the daemon's rules. Tools only.
#pragma once

#include <functional>
#include <string>

#include "daemon/core/config/options/config.h"
#include "tools/diagnose/data/signal_table.h"

namespace beltgrip::cli {

// Throws Failure: 66 the log is missing, 65 it has no frame that carries a role.
// on_read: now and then, with the log's time and the share of it that is read.
// as_read: speeds and engine torque with their spikes; the gate that leaves them out delays steps
// too, and leaves gaps at them.
diagnose::SignalTable read_log(const std::string& path, const daemon::Config& config,
                               bool as_read = false,
                               const std::function<void(double, double)>& on_read = {});

}  // namespace beltgrip::cli
