#include "daemon/io/carried_keeper.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>

#include "daemon/core/config/load/config_fingerprint.h"
#include "daemon/io/json_text.h"

namespace beltgrip::daemon {

namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr int kVersion = 1;

// Every number of a bound under its name in the file: one list for both ways.
struct Field {
  const char* name;
  double CarriedBound::*value;
};
constexpr std::array kFields{Field{"mu_star", &CarriedBound::mu_star},
                             Field{"mu_max_lower_bound", &CarriedBound::mu_max_least},
                             Field{"time_s", &CarriedBound::time_s},
                             Field{"torque_Nm", &CarriedBound::torque_Nm},
                             Field{"clamp_force_N", &CarriedBound::clamp_force_N},
                             Field{"primary_speed_rad_s", &CarriedBound::omega_p_rad_s},
                             Field{"oil_degC", &CarriedBound::oil_degC},
                             Field{"held_s", &CarriedBound::held_s},
                             Field{"force_N_s", &CarriedBound::force_N_s},
                             Field{"used_N_s", &CarriedBound::used_N_s},
                             Field{"counted_until_s", &CarriedBound::counted_until_s},
                             Field{"refused_mu_star", &CarriedBound::refused_mu_star}};

bool says_something(const CarriedBound& bound) {
  return bound.known() || bound.refused_mu_star > 0.0;
}

std::string direction_text(std::size_t group) {
  return estimator::direction_of(group) == estimator::Direction::kDrive ? "drive" : "overrun";
}
std::string end_stop_text(std::size_t group) {
  return estimator::end_stop_of(group) == estimator::EndStop::kOverdrive ? "overdrive" : "low";
}

Json to_file(const CarriedBounds& bounds) {
  Json all = Json::array();
  for (std::size_t group = 0; group < bounds.size(); ++group) {
    if (!says_something(bounds[group])) continue;
    Json one{{"direction", direction_text(group)}, {"ratio", end_stop_text(group)}};
    for (const Field& field : kFields) one[field.name] = bounds[group].*field.value;
    all.push_back(std::move(one));
  }
  return all;
}

// Throws nlohmann's exceptions. What no program of this project has written is refused.
CarriedBounds from_file(const Json& all) {
  CarriedBounds bounds{};
  for (const Json& one : all) {
    for (std::size_t group = 0; group < bounds.size(); ++group) {
      if (one.at("direction") != direction_text(group) || one.at("ratio") != end_stop_text(group)) {
        continue;
      }
      CarriedBound bound;
      for (const Field& field : kFields) {
        const Json& value = one.at(field.name);
        if (!value.is_null()) bound.*field.value = value.get<double>();
      }
      const bool sane = bound.mu_star >= 0.0 && bound.mu_star < 1.0 && bound.mu_max_least >= 0.0 &&
                        bound.mu_max_least <= bound.mu_star && bound.held_s >= 0.0 &&
                        bound.force_N_s >= 0.0 && bound.used_N_s >= 0.0;
      if (sane) bounds[group] = bound;
    }
  }
  return bounds;
}

std::string path_in(const std::string& folder) {
  return (fs::path(folder) / kCarriedFile).string();
}

// The whole file; nothing where there is none. Throws what is wrong with it.
Json read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::error_code ignored;
  if (!file && !fs::exists(path, ignored)) return nullptr;
  if (!file) throw std::runtime_error(std::strerror(errno));
  Json all = json_of({std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()});
  if (all.at("version") != kVersion) throw std::runtime_error("it is of another version");
  if (!all.at("configurations").is_object()) throw std::runtime_error("it has no configurations");
  return all;
}

// Beside it first and then renamed: what is read is one or the other, whole.
bool write_file(const std::string& path, const std::string& text) {
  const std::string beside = path + ".new";
  std::FILE* file = std::fopen(beside.c_str(), "we");
  if (file == nullptr) return false;
  bool good = std::fwrite(text.data(), 1, text.size(), file) == text.size() &&
              std::fflush(file) == 0 && fsync(fileno(file)) == 0;
  int why = errno;
  if (std::fclose(file) != 0 && good) {
    good = false;
    why = errno;
  }
  if (good && std::rename(beside.c_str(), path.c_str()) == 0) return true;
  if (good) why = errno;
  std::remove(beside.c_str());
  errno = why;
  return false;
}

}  // namespace

Json carried_json(const CarriedBounds& bounds) {
  Json all = Json::array();
  for (std::size_t group = 0; group < bounds.size(); ++group) {
    const CarriedBound& bound = bounds[group];
    if (!says_something(bound)) continue;
    const bool known = bound.known();
    const auto number = [&](double value) { return known ? Json(value) : Json(); };
    const std::optional<double> reserve = reserve_share(bound);
    const bool refused = bound.refused_mu_star > 0.0;
    all.push_back({{"direction", direction_text(group)},
                   {"ratio", end_stop_text(group)},
                   {"mu_max_lower_bound", number(bound.mu_max_least)},
                   {"mu_star", number(bound.mu_star)},
                   {"time_s", number(bound.time_s)},
                   {"torque_Nm", number(bound.torque_Nm)},
                   {"clamp_force_N", number(bound.clamp_force_N)},
                   {"primary_speed_rad_s", number(bound.omega_p_rad_s)},
                   {"oil_degC", number(bound.oil_degC)},
                   {"reserve_share", reserve ? Json(*reserve) : Json()},
                   {"held_s", bound.held_s},
                   {"impossible_mu_star", refused ? Json(bound.refused_mu_star) : Json()}});
  }
  return all;
}

std::string carried_json_text(const CarriedBounds& bounds) { return carried_json(bounds).dump(); }

Result<CarriedBounds> read_carried(const std::string& folder, const std::string& fingerprint) {
  try {
    const Json all = read_file(path_in(folder));
    if (all.is_null()) return CarriedBounds{};
    const Json& configurations = all.at("configurations");
    const std::string name =
        fingerprint.empty() ? all.at("newest").get<std::string>() : fingerprint;
    if (!configurations.contains(name)) return CarriedBounds{};
    return from_file(configurations.at(name));
  } catch (const std::exception& error) {
    return std::string(error.what());
  }
}

CarriedKeeper::CarriedKeeper(std::string folder, const Config& config, Say say)
    : folder_(std::move(folder)),
      fingerprint_(config_fingerprint(config)),
      record_(config),
      say_(std::move(say)) {
  open();
}

CarriedKeeper::~CarriedKeeper() { write(); }

void CarriedKeeper::open() {
  said_ = {};
  if (folder_.empty()) return;
  const Result<CarriedBounds> found = read_carried(folder_, fingerprint_);
  if (found) {
    record_.restore(*found);
    said_ = *found;
    return;
  }
  const std::string path = path_in(folder_);
  std::error_code error;
  fs::rename(path, path + ".bad", error);
  say_(true, path + ": found no record of what was carried (" + found.error() + ")" +
                 (error ? "" : "; it is kept as " + path + ".bad, and a new one begun"));
}

void CarriedKeeper::take(const CarriedWindow& window, double time_s) {
  unwritten_ = true;
  if (!record_.take(window, time_s)) return;
  const std::size_t group = estimator::belt_group(window.direction, window.end_stop);
  const CarriedBound& bound = record_.bounds()[group];
  if (bound.mu_max_least < (1.0 + kNews) * said_[group].mu_max_least) return;
  said_[group] = bound;
  say_(false, group_text(group) + ": " + carried_text(bound));
}

void CarriedKeeper::change(const Config& config) {
  const std::string fingerprint = config_fingerprint(config);
  if (fingerprint == fingerprint_) return;
  write();
  fingerprint_ = fingerprint;
  record_ = CarriedRecord(config);
  open();
}

void CarriedKeeper::turn(double now_s) {
  // A clock that was set back must not put it off.
  if (!unwritten_ || std::abs(now_s - written_s_) < kWrite_s) return;
  written_s_ = now_s;
  write();
}

bool CarriedKeeper::write() {
  if (!unwritten_ || folder_.empty()) return true;
  const std::string path = path_in(folder_);
  std::error_code ignored;
  fs::create_directories(folder_, ignored);
  Json all;
  try {
    all = read_file(path);
  } catch (const std::exception&) {
    all = nullptr;  // someone has damaged it since it was read
  }
  if (all.is_null()) all = {{"version", kVersion}, {"configurations", Json::object()}};
  all["newest"] = fingerprint_;
  all["configurations"][fingerprint_] = to_file(record_.bounds());
  unwritten_ = !write_file(path, all.dump(2) + "\n");
  if (unwritten_ && !complained_) {
    say_(true, path + ": what was carried cannot be written (" + std::strerror(errno) +
                   "); it is kept in memory, next attempt in a minute");
  }
  complained_ = unwritten_;
  return !unwritten_;
}

}  // namespace beltgrip::daemon
