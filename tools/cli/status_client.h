// Asks a running beltgripd what it sees, over the socket in its runtime directory. Tools only.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace beltgrip::cli {

struct Status {
  std::string text;               // one JSON object and a line end, as it came
  nlohmann::ordered_json values;  // daemon/io/status_server.h
};

// interface empty: that of the only daemon. Failure 69: none runs; 64: several do.
std::string status_socket(const std::string& interface);

// Failure 69: nobody answers; 65: what answers is no daemon.
Status ask_status(const std::string& socket_path);

}  // namespace beltgrip::cli
