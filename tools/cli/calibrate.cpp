// beltgrip calibrate: constants of the configuration from recorded drives, each with its
// uncertainty, or the reason why these drives do not tell it.
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "can_dbc/text/format.h"
#include "estimator/statistics/interval.h"
#include "tools/calibrate/calibrate.h"
#include "tools/cli/command.h"
#include "tools/cli/configuration.h"
#include "tools/cli/log_configuration.h"
#include "tools/cli/log_table.h"
#include "tools/cli/output_file.h"
#include "tools/cli/progress.h"
#include "tools/cli/stop_signals.h"
#include "tools/text/json_writer.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

using calibrate::Finding;

struct CalibrateOptions {
  std::vector<std::string> logs;
  std::string config;
  std::string json;
  std::string out;
  double rate_Hz = 0.0;
  bool force = false;
  bool quiet = false;
};

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
  text::JsonWriter json;
  json.begin_object().key("findings").begin_array();
  for (const Finding& each : findings) {
    const double half = estimator::kNormal95 * each.std;
    json.begin_object().field("key", each.key).field("value", each.value.value_or(text::kJsonNull));
    json.field("std", each.value ? each.std : text::kJsonNull);
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

// Without what the arithmetic left behind the last digits.
double to_twelve_digits(double value) {
  const double scale =
      std::pow(10.0, 11.0 - std::floor(std::log10(std::max(std::abs(value), 1e-9))));
  return std::round(value * scale) / scale;
}

double delay_of(const daemon::RoleBinding& role, double delay_s) {
  return std::round(10.0 * (role.delay_ms + 1e3 * delay_s)) / 10.0;
}

// A column of a table that is called like message and signal is one of frames, too.
std::string place_of(const daemon::RoleBinding& role, bool table) {
  if (!table) return "signal = \"" + role.message_name + "." + role.signal_name + "\"";
  const bool of_frames = role.message_name.find('.') != std::string::npos &&
                         role.message_name.find(' ') == std::string::npos;
  return (of_frames ? "signal = \"" : "column = \"") + role.message_name + "\"";
}

// The role as the user has it, in his unit and scale, less what it reads at zero, and later by
// `delay_s`.
std::string role_line(const daemon::Config& config, daemon::Role wanted, double zero,
                      double delay_s) {
  for (const daemon::RoleBinding& role : config.roles) {
    if (role.role != wanted) continue;
    const auto scaling = [](double scale, double offset) {
      return (scale != 1.0 ? ", scale = " + exact(scale) : "") +
             (offset != 0.0 ? ", offset = " + exact(offset) : "");
    };
    const auto less_zero = [&](double offset) {
      const double unit_factor = role.factor / role.scale;
      return zero == 0.0 ? offset : to_twelve_digits(offset - zero / unit_factor);
    };
    std::string line = std::string(daemon::role_name(wanted)) + " = { ";
    if (role.uds) {
      const can::SignalDef& signal = role.uds->signal;
      line += format("uds = { request = 0x%X, response = 0x%X, did = 0x%04X, start = %u, ",
                     role.uds->request.value, role.uds->response.value,
                     unsigned{role.uds->identifier}, signal.start_bit) +
              format("length = %u, byte_order = \"%s\", signed = %s", signal.length,
                     signal.byte_order == can::ByteOrder::kBig ? "big" : "little",
                     signal.type == can::ValueType::kSigned ? "true" : "false") +
              scaling(signal.scale, less_zero(signal.offset)) + " }";
    } else {
      line += place_of(role, config.table != nullptr);
    }
    line += ", unit = \"" + role.unit + "\"";
    if (!role.uds) line += scaling(role.scale, less_zero(role.offset));
    if (role.bus != 0 && config.further_bus) line += ", bus = \"" + config.further_bus->name + "\"";
    if (role.period_ms) line += ", period_ms = " + exact(*role.period_ms);
    const double delay_ms = delay_of(role, delay_s);
    if (delay_ms != 0.0) line += ", delay_ms = " + exact(delay_ms);
    return line + " }";
  }
  return {};
}

std::string toml(const std::vector<Finding>& findings, const daemon::Config& config,
                 const CalibrateOptions& options) {
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
      const bool gain_stated =
          std::none_of(config.assumed.begin(), config.assumed.end(), [](const std::string& key) {
            return key.starts_with("sensors.secondary_pressure.gain");
          });
      sensors += "secondary_pressure = { bias_Pa = " + exact(each.std);
      if (gain_stated) sensors += ", gain = " + exact(config.sensors.secondary_pressure.gain);
      sensors += " }\n";
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
  const auto name = [](const std::string& path) {
    return std::filesystem::path(path).filename().string();
  };
  out += ".\n# In a third file, the keys here take the place of those there: include = [\"" +
         name(options.config) + "\", \"" +
         (options.out == "-" ? "calibrated.toml" : name(options.out)) + "\"]\n" + remarks;
  if (!signals.empty()) out += "\n[signals]\n" + signals;
  if (!sensors.empty()) out += "\n[sensors]\n" + sensors;
  if (!variator.empty()) out += "\n[variator]\n" + variator;
  return out;
}

// What is written must load: each finding alone, over the configuration that it is for.
void keep_what_loads(std::vector<Finding>& findings, const daemon::Config& config,
                     const CalibrateOptions& options) {
  for (Finding& each : findings) {
    if (!each.value) continue;
    const std::string lines = toml({each}, config, options);
    const std::string why =
        why_refused(lines, std::filesystem::absolute(options.config).string(), config.table);
    if (why.empty()) continue;
    each.text = "found " + rounded(*each.value, each.std) + " " + each.unit +
                ", which no configuration takes (" + why + "); " + each.text;
    each.value.reset();
  }
}

void run_calibrate(const CalibrateOptions& options) {
  if (options.json == "-" && options.out == "-") {
    throw Failure{kUsage, "calibrate: only one of --json and --out can be standard output"};
  }
  end_logs_when_stopped(options.logs);
  const daemon::Config config =
      load_configuration_for(options.logs, options.rate_Hz, options.config, "");
  Inputs inputs(options.logs);
  inputs.add(config.files);
  std::optional<OutputFile> json, out;
  if (!options.json.empty()) json.emplace(options.json, inputs, Existing::kReplaceResult);
  if (!options.out.empty()) out.emplace(options.out, inputs, unless_forced(options.force));
  std::vector<diagnose::SignalTable> logs;
  Progress progress(!options.quiet);
  double read_s = 0.0, newest_s = 0.0;
  for (const std::string& path : options.logs) {
    if (!logs.empty() && stop_asked()) break;
    logs.push_back(read_log(path, config, true, [&](double log_s, double share) {
      const double before = static_cast<double>(logs.size());
      progress.tell(read_s + log_s, "s of the logs", "times real time",
                    (before + share) / static_cast<double>(options.logs.size()));
      newest_s = log_s;
    }));
    read_s += newest_s;
    progress.clear();
    for (const std::string& note : logs.back().notes) {
      text::warn(note);
    }
  }
  std::vector<Finding> findings = calibrate::calibrate(logs, config);
  keep_what_loads(findings, config, options);
  if (json) json->write(json_text(findings));
  if (out) out->write(toml(findings, config, options));
  if (json) json->close();
  if (out) out->close();
  if (options.json != "-" && options.out != "-") text::print(stdout, table(findings));
}

}  // namespace

void add_calibrate(command_line::Command app) {
  const command_line::Command command = app.add_subcommand(
      "calibrate",
      "End-stop ratios, zero of the pressure, inertia and delays from recorded drives");
  auto options = std::make_shared<CalibrateOptions>();
  command
      .add_option("LOG", options->logs,
                  "CAN logs of drives, or tables of signals (.csv), all of the same vehicle")
      .type_name("")
      .required();
  command.add_option("--config", options->config, "BeltGrip's configuration")
      .type_name("FILE")
      .required();
  add_rate_option(command, options->rate_Hz);
  command.add_option("--json", options->json, "As JSON, '-': standard output").type_name("FILE");
  command.add_option("--out", options->out, "The keys as TOML, '-': standard output")
      .type_name("FILE");
  command.add_flag("--force", options->force, "Replace the file of --out where it exists");
  command.add_flag("--quiet", options->quiet, kNoProgress);
  command.example(
      "beltgrip calibrate drive/trace.log --config drive/beltgrip.toml --out found.toml");
  command.callback([options] { run_calibrate(*options); });
}

}  // namespace beltgrip::cli
