// beltgrip calibrate: constants of the configuration from recorded drives, each with its
// uncertainty, or the reason why these drives do not tell it.
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "tools/calibrate/calibrate.h"
#include "tools/cli/command.h"
#include "tools/cli/configuration.h"
#include "tools/cli/json_writer.h"
#include "tools/cli/log_table.h"
#include "tools/cli/output_file.h"

namespace beltgrip::cli {

namespace {

using calibrate::Finding;

struct Options {
  std::vector<std::string> logs;
  std::string config;
  std::string json;
  std::string out;
};

std::string format(const char* pattern, auto... values) {
  std::array<char, 400> line;
  std::snprintf(line.data(), line.size(), pattern, values...);
  return line.data();
}

// To a digit beyond its standard deviation.
std::string rounded(double value, double std) {
  int digits = 6;
  if (std > 0.0) digits = std::max(0, static_cast<int>(std::ceil(1.0 - std::log10(std))));
  std::array<char, 64> text;
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value,
                                 std::chars_format::fixed, std::min(digits, 12))
                       .ptr;
  std::string number(text.data(), end);
  return number.find('.') == std::string::npos ? number + ".0" : number;
}

std::string exact(double value) {
  std::array<char, 40> text;
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  std::string number(text.data(), end);
  return number.find_first_of(".en") == std::string::npos ? number + ".0" : number;
}

std::string with_unit(const std::string& text, const std::string& unit) {
  return unit.empty() ? text : text + " " + unit;
}

std::string table(const std::vector<Finding>& findings) {
  std::string out;
  for (const Finding& each : findings) {
    out += each.key + ": ";
    if (each.value) {
      out +=
          with_unit(rounded(*each.value, each.std) + " +- " + format("%.2g", each.std), each.unit);
    } else {
      out += "not written";
    }
    out += "\n  " + each.text + "\n";
  }
  return out;
}

std::string json_text(const std::vector<Finding>& findings) {
  JsonWriter json;
  json.begin_object().key("findings").begin_array();
  for (const Finding& each : findings) {
    const double half = 1.96 * each.std;
    json.begin_object().field("key", each.key).field("value", each.value.value_or(kJsonNull));
    json.field("std", each.value ? each.std : kJsonNull);
    json.key("ci95");
    if (each.value) {
      json.begin_array().value(*each.value - half).value(*each.value + half).end_array();
    } else {
      json.null();
    }
    json.field("unit", each.unit).field(each.value ? "basis" : "refused", each.text).end_object();
  }
  return json.end_array().end_object().take() + '\n';
}

// The role as it is, less what it reads at zero, and later by `delay_s`; in SI, so that nothing has
// to be converted.
std::string role_line(const daemon::Config& config, daemon::Role wanted, double zero,
                      double delay_s) {
  for (const daemon::RoleBinding& role : config.roles) {
    if (role.role != wanted) continue;
    const can::Dimension dimension = daemon::role_dimension(wanted);
    const char* unit = dimension == can::Dimension::kPressure ? "Pa"
                       : dimension == can::Dimension::kTorque ? "Nm"
                                                              : "rad/s";
    const double shift = role.shift - zero;
    std::string line = std::string(daemon::role_name(wanted)) + " = { ";
    if (role.uds) {
      const can::SignalDef& signal = role.uds->signal;
      line += format("uds = { request = 0x%X, response = 0x%X, did = 0x%04X, start = %u, ",
                     role.uds->request.value, role.uds->response.value,
                     unsigned{role.uds->identifier}, signal.start_bit) +
              format("length = %u, byte_order = \"%s\", signed = %s", signal.length,
                     signal.byte_order == can::ByteOrder::kBig ? "big" : "little",
                     signal.type == can::ValueType::kSigned ? "true" : "false") +
              ", scale = " + exact(role.factor * signal.scale) +
              ", offset = " + exact(role.factor * signal.offset + shift) + " }, unit = \"" + unit +
              "\"";
    } else {
      line += "signal = \"" + role.message_name + "." + role.signal_name + "\", unit = \"" + unit +
              "\", scale = " + exact(role.factor) + ", offset = " + exact(shift);
    }
    if (role.bus != 0 && config.further_bus) line += ", bus = \"" + config.further_bus->name + "\"";
    if (role.period_ms) line += ", period_ms = " + exact(*role.period_ms);
    const double delay_ms = std::round(10.0 * (role.delay_ms + 1e3 * delay_s)) / 10.0;
    if (delay_ms != 0.0) line += ", delay_ms = " + exact(delay_ms);
    return line + " }";
  }
  return {};
}

std::string toml(const std::vector<Finding>& findings, const daemon::Config& config,
                 const Options& options) {
  std::string signals, sensors, variator, remarks;
  for (const Finding& each : findings) {
    if (!each.value) {
      remarks += "# " + each.key + " is not written: " + each.text + "\n";
      continue;
    }
    const std::string number = rounded(*each.value, each.std);
    const std::string deviation = format("%.2g", each.std);
    if (each.key == "signals.secondary_pressure") {
      signals += role_line(config, daemon::Role::kSecondaryPressure, *each.value, 0.0);
      signals.append("  # read ").append(number).append(" Pa at zero, +- ").append(deviation);
      signals.append("\n");
      sensors += "secondary_pressure = { bias_Pa = " + exact(each.std) + " }\n";
    } else if (each.key.starts_with("variator.")) {
      variator.append(each.key.substr(9)).append(" = ").append(number).append("  # +- ");
      variator.append(deviation).append("; ").append(each.text).append("\n");
    } else {
      const daemon::Role role = each.key == "delay.secondary_speed" ? daemon::Role::kSecondarySpeed
                                                                    : daemon::Role::kEngineTorque;
      signals += role_line(config, role, 0.0, *each.value);
      signals += format("  # later by %.1f +- %.1f ms than configured; ", 1e3 * *each.value,
                        1e3 * each.std) +
                 each.text + "\n";
    }
  }
  std::string out = "# Written by beltgrip calibrate from";
  for (const std::string& log : options.logs) out += " " + log;
  out += ".\n# Take these lines over into the sections of " + options.config + ".\n" + remarks;
  if (!signals.empty()) out += "\n[signals]\n" + signals;
  if (!sensors.empty()) out += "\n[sensors]\n" + sensors;
  if (!variator.empty()) out += "\n[variator]\n" + variator;
  return out;
}

void run(const Options& options) {
  const daemon::Config config = load_configuration(options.config, "");
  std::vector<diagnose::SignalTable> logs;
  for (const std::string& path : options.logs) {
    logs.push_back(read_log(path, config));
    for (const std::string& note : logs.back().notes) {
      std::fprintf(stderr, "beltgrip: warning: %s\n", note.c_str());
    }
  }
  const std::vector<Finding> findings = calibrate::calibrate(logs, config);
  if (!options.json.empty()) write_file(options.json, json_text(findings));
  if (!options.out.empty()) write_file(options.out, toml(findings, config, options));
  if (options.json != "-" && options.out != "-") std::fputs(table(findings).c_str(), stdout);
}

}  // namespace

void add_calibrate(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "calibrate",
      "End-stop ratios, zero of the pressure, inertia and delays from recorded drives");
  auto options = std::make_shared<Options>();
  command->add_option("log", options->logs, "CAN logs of drives, all of the same vehicle")
      ->required();
  command->add_option("--config", options->config, "BeltGrip's configuration")->required();
  command->add_option("--json", options->json, "As JSON, '-': standard output");
  command->add_option("--out", options->out, "The keys as TOML, '-': standard output");
  command->callback([options] { run(*options); });
}

}  // namespace beltgrip::cli
