// What beltgripd says of itself, in words and as metrics. Every function throws
// nlohmann::json::exception where the values are not those of a daemon. Tools only.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace beltgrip::cli {

// All of it, a line each.
std::string status_text(const nlohmann::ordered_json& status);

// One line of what changes seldom: state, faults, inhibits, last result (without its age).
std::string status_line(const nlohmann::ordered_json& status);

// In Prometheus' text format, for the textfile collector of node-exporter. `interface` is the label
// of every sample. null: nobody answered, which is beltgrip_up 0 and nothing else.
std::string status_metrics(const nlohmann::ordered_json& status, const std::string& interface);

}  // namespace beltgrip::cli
