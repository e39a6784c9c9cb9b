// beltgrip can: sets up a CAN interface, takes it down, shows what its controller says.
#include "tools/cli/can.h"

#include <cstdio>
#include <memory>
#include <string>

#include "can_dbc/text/printable.h"
#include "daemon/io/can_link.h"
#include "tools/cli/failure.h"
#include "tools/text/json_writer.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

using daemon::CanLink;

struct CanOptions {
  std::string interface;
  daemon::CanLinkSetting setting;
  bool json = false;
};

CanLink link_of(const std::string& interface) {
  daemon::Result<CanLink> link = daemon::read_can_link(interface);
  if (!link) throw Failure{kUnavailable, link.error()};
  return *std::move(link);
}

void field(text::JsonWriter& json, const char* name, const auto& value) {
  json.key(name);
  if (value) {
    json.value(*value);
  } else {
    json.null();
  }
}

std::string json_text(const CanLink& link) {
  text::JsonWriter json;
  json.begin_object().field("interface", link.interface).field("up", link.up);
  json.field("driver", link.driver).field("controller", link.has_controller);
  field(json, "state", link.state);
  json.key("bit_timing");
  if (link.bitrate) {
    json.begin_object().field("bitrate", *link.bitrate);
    field(json, "sample_point", link.sample_point);
    json.end_object();
  } else {
    json.null();
  }
  field(json, "restart_ms", link.restart_ms);
  json.key("error_counters");
  if (link.error_counters) {
    json.begin_object()
        .field("transmit", link.error_counters->transmit)
        .field("receive", link.error_counters->receive)
        .end_object();
  } else {
    json.null();
  }
  json.key("controller_counters");
  if (link.device_counters) {
    const CanLink::DeviceCounters& counted = *link.device_counters;
    json.begin_object()
        .field("restarts", counted.restarts)
        .field("bus_errors", counted.bus_errors)
        .field("warnings", counted.warnings)
        .field("passives", counted.passives)
        .field("bus_offs", counted.bus_offs)
        .field("arbitration_lost", counted.arbitration_lost)
        .end_object();
  } else {
    json.null();
  }
  json.field("queue_length", link.queue_length).key("frames");
  if (link.frame_counters) {
    const CanLink::FrameCounters& counted = *link.frame_counters;
    json.begin_object()
        .field("received", counted.received)
        .field("sent", counted.sent)
        .field("receive_errors", counted.receive_errors)
        .field("transmit_errors", counted.transmit_errors)
        .field("received_dropped", counted.received_dropped)
        .field("sent_dropped", counted.sent_dropped)
        .field("overruns", counted.overruns)
        .end_object();
  } else {
    json.null();
  }
  return json.end_object().take();
}

std::string number_or(const auto& value, const char* unit) {
  return value ? std::to_string(*value) + unit : std::string("the controller does not say");
}

void print(const CanLink& link) {
  const auto line = [](const char* name, const std::string& text) {
    std::printf("%-16s %s\n", name, can::printable(text).c_str());
  };
  line("interface", link.interface + (link.up ? ", up" : ", down") + ", driver " +
                        (link.driver.empty() ? "unknown" : link.driver));
  if (!link.has_controller) {
    line("controller", "none: a virtual interface has no state, bit rate or error counters");
  } else {
    line("state", std::string(link.state.value_or("the controller does not say")));
    std::string timing = number_or(link.bitrate, " bit/s");
    if (link.sample_point) {
      char point[32];
      std::snprintf(point, sizeof point, ", sample point %.1f %%", 100.0 * *link.sample_point);
      timing += point;
    }
    line("bit timing", timing);
    line("restart", link.restart_ms == 0U ? "none after bus-off"
                                          : number_or(link.restart_ms, " ms after bus-off"));
    line("error counters", link.error_counters
                               ? "transmit " + std::to_string(link.error_counters->transmit) +
                                     ", receive " + std::to_string(link.error_counters->receive)
                               : "the controller does not say");
    if (link.device_counters) {
      const CanLink::DeviceCounters& counted = *link.device_counters;
      line("since it is up", std::to_string(counted.bus_offs) + " bus-off, " +
                                 std::to_string(counted.restarts) + " restarts, " +
                                 std::to_string(counted.passives) + " passive, " +
                                 std::to_string(counted.warnings) + " warnings, " +
                                 std::to_string(counted.bus_errors) + " bus errors, " +
                                 std::to_string(counted.arbitration_lost) + " arbitration lost");
    }
  }
  line("queue length", std::to_string(link.queue_length) + " frames");
  if (link.frame_counters) {
    const CanLink::FrameCounters& counted = *link.frame_counters;
    line("received", std::to_string(counted.received) + ", " +
                         std::to_string(counted.receive_errors) + " errors, " +
                         std::to_string(counted.received_dropped) + " dropped, " +
                         std::to_string(counted.overruns) + " overruns");
    line("sent", std::to_string(counted.sent) + ", " + std::to_string(counted.transmit_errors) +
                     " errors, " + std::to_string(counted.sent_dropped) + " dropped");
  }
}

void demand(const std::string& failure) {
  if (!failure.empty()) throw Failure{kUnavailable, failure};
}

}  // namespace

void add_can(command_line::Command app) {
  const command_line::Command can =
      app.add_subcommand("can", "Set up a CAN interface, or show its state");
  can.require_subcommand();
  auto options = std::make_shared<CanOptions>();
  const auto subcommand = [&](const char* name, const char* help) {
    const command_line::Command command = can.add_subcommand(name, help);
    command.add_option("INTERFACE", options->interface, "A CAN interface").type_name("").required();
    return command;
  };

  // The variables are those of beltgrip-can@.service; an empty one counts as not given.
  const command_line::Command up = subcommand("up", "Set what is given, then bring it up");
  up.add_option("--bitrate", options->setting.bitrate, "bit/s")
      .envname("CAN_BITRATE")
      .range(1000U, 8'000'000U);
  up.add_option("--sample-point", options->setting.sample_point,
                "Share of a bit's time after which it is read")
      .envname("CAN_SAMPLE_POINT")
      .range(0.3, 0.95);
  up.add_option("--restart-ms", options->setting.restart_ms,
                "Milliseconds from bus-off to the restart, 0: none")
      .envname("CAN_RESTART_MS")
      .range(0U, 60'000U);
  up.add_option("--queue-length", options->setting.queue_length,
                "Frames that may wait for the controller")
      .envname("CAN_QUEUE_LENGTH")
      .range(1, 10'000);
  up.example("beltgrip can up can0 --bitrate 500000");
  up.callback(
      [options] { demand(daemon::bring_up(link_of(options->interface), options->setting)); });

  const command_line::Command down = subcommand("down", "Take it down");
  down.example("beltgrip can down can0");
  down.callback([options] { demand(daemon::bring_down(link_of(options->interface))); });

  const command_line::Command status =
      subcommand("status", "State, error counters, bit timing, restarts, drops");
  status.add_flag("--json", options->json, "As one JSON object; null: nobody can say");
  status.example("beltgrip can status can0");
  status.callback([options] {
    const CanLink link = link_of(options->interface);
    if (options->json) {
      std::puts(json_text(link).c_str());
    } else {
      print(link);
    }
  });
}

}  // namespace beltgrip::cli
