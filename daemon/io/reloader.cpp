#include "daemon/io/reloader.h"

#include <utility>

#include "can_dbc/text/number_text.h"
#include "daemon/core/config/load/config_fingerprint.h"
#include "daemon/core/config/load/config_reload.h"
#include "daemon/core/config/load/load_config.h"
#include "daemon/core/publish/own_frames.h"
#include "daemon/io/rt_setup.h"

namespace beltgrip::daemon {

namespace {

std::string quoted(const std::string& text) { return '"' + text + '"'; }

// What a daemon holds as long as it lives; empty: nothing of it has changed.
std::string needs_restart(const Config& running, const Config& found) {
  const auto line = [](const char* key, const std::string& now, const std::string& before) {
    return std::string(key) + ": found " + now + ", expected " + before +
           " (only a restart changes it)";
  };
  if (found.interface != running.interface) {
    return line("bus.interface", quoted(found.interface), quoted(running.interface));
  }
  const auto further = [](const Config& config) {
    return config.further_bus ? config.further_bus->interface : std::string();
  };
  if (further(found) != further(running)) {
    std::string key = "bus";
    for (const Config* config : {&found, &running}) {
      if (key == "bus" && config->further_bus) key += "." + config->further_bus->name;
    }
    return line((key + ".interface").c_str(), quoted(further(found)), quoted(further(running)));
  }
  if (found.state_dir != running.state_dir) {
    return line("daemon.state_dir", quoted(found.state_dir), quoted(running.state_dir));
  }
  if (found.estimator.sample_rate_hz != running.estimator.sample_rate_hz) {
    return line("estimator.sample_rate_hz", number_text(found.estimator.sample_rate_hz),
                number_text(running.estimator.sample_rate_hz));
  }
  return {};
}

}  // namespace

std::vector<WantedFrames> wanted_frames(const Config& config) {
  std::vector<WantedFrames> wanted;
  wanted.reserve(2 * config.roles.size() + kOwnMessageCount);
  for (const RoleBinding& role : config.roles) {
    wanted.push_back({role.id, role.sources.any(), role.bus});
    // Another tester's requests: it has the right of way.
    if (role.uds) wanted.push_back({role.uds->request, false, role.bus});
  }
  // Our own: an echo says that a frame has left, another node's is a fault.
  for (std::size_t i = 0; i < kOwnMessageCount; ++i) {
    wanted.push_back(
        {{own_identifier(config.identifiers, static_cast<OwnMessage>(i)), false}, false});
  }
  return wanted;
}

Reloader::Reloader(std::string path, const Config& running, ReloadSlot& slot, BusClaim* claim,
                   Say say)
    : path_(std::move(path)), running_(running), slot_(slot), claim_(claim), say_(std::move(say)) {}

bool Reloader::request() {
  const ConfigResult loaded = reload_config(path_);
  std::string wrong;
  if (!loaded.config) {
    wrong = loaded.errors.front().text;
    const std::size_t more = loaded.errors.size() - 1;
    if (more > 0) wrong += " (and " + std::to_string(more) + " more)";
  } else if (wrong = needs_restart(running_, *loaded.config); !wrong.empty()) {
    wrong = path_ + ": " + wrong;
  } else if (claim_ != nullptr && !claim_->add(loaded.config->identifiers)) {
    wrong = path_ + ": " + claim_->refused();
  }
  if (!loaded.config || !wrong.empty()) {
    say_(true, "reload refused, the old configuration stays: " + wrong);
    return false;
  }
  const Config& config = *loaded.config;
  std::unique_ptr<Reload> reload(
      new Reload{config, wanted_frames(config), false, Pipeline(config)});
  if (const std::string assumed = assumed_text(config); !assumed.empty()) say_(false, assumed);
  // What the real-time thread is about to touch.
  if (std::string memory; !lock_memory(memory)) say_(false, "reload: " + memory);
  if (waiting_ && slot_.offer(nullptr) == nullptr) {
    next_ = std::move(reload);  // what waited was taken meanwhile
  } else {
    offer(std::move(reload));
  }
  waiting_ = true;
  return true;
}

// Nothing is on its way to the real-time thread or back: running_ is what it replaces.
void Reloader::offer(std::unique_ptr<Reload> reload) {
  reload->keeps_results = config_fingerprint(reload->config) == config_fingerprint(running_);
  slot_.offer(std::move(reload));
}

bool Reloader::turn() {
  const std::unique_ptr<Reload> taken = slot_.collect();
  if (taken == nullptr) return false;
  running_ = taken->config;
  waiting_ = next_ != nullptr;
  // The identifiers of one that waits are claimed too.
  if (waiting_) {
    offer(std::move(next_));
  } else if (claim_ != nullptr) {
    claim_->keep(running_.identifiers);
  }
  say_(false, "reload: " + path_ + " is in force");
  return true;
}

}  // namespace beltgrip::daemon
