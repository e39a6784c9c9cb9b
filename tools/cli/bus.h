// A bus for the subcommands that work in real time: opened by name, played onto frame by frame.
// Tools only.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "can_dbc/frame/can_frame.h"
#include "daemon/core/base/port.h"
#include "daemon/core/config/options/config.h"

namespace beltgrip::cli {

// A SocketCAN interface or inproc:NAME. Throws Failure 69. Receives these identifiers only. Where
// `stop_fd` (stop_signals.h) is readable, the port's waiting ends.
std::unique_ptr<daemon::Port> open_bus(const std::string& name,
                                       const std::vector<can::CanId>& identifiers, int stop_fd);

// The buses of a configuration, and every frame on them. Throws Failure 69.
std::unique_ptr<daemon::Port> open_buses_whole(const daemon::Config& config, int stop_fd);

// Sends what next() gives, at the frames' distances in time divided by speed. False when it was
// stopped before the end. Throws Failure 69 when the bus goes away.
bool play(daemon::Port& port, const std::string& name, double speed,
          const std::function<bool(can::StampedFrame&)>& next);

// A node that answers. Every millisecond of its own time, `advance` gets that time and the frames
// that have come, leaves the frames to be sent, and returns false at its end. What a bus that is
// down or full does not take is lost, as on any node. False when it was stopped before the end.
using NodeStep = std::function<bool(std::int64_t now_ns, std::span<const daemon::RxFrame> received,
                                    std::vector<can::CanFrame>& out)>;
bool play_node(daemon::Port& port, double speed, const NodeStep& advance);

}  // namespace beltgrip::cli
