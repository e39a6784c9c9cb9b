// Answers `beltgrip status`: whoever connects to the socket status.sock in the runtime directory
// gets one JSON object and the end of the stream. Never waits for a reader. Helper thread only.
#pragma once

#include <string>

#include "daemon/core/config/options/config.h"
#include "daemon/core/observe/carried_record.h"
#include "daemon/core/observe/observation.h"

namespace beltgrip::daemon {

// Absent things are null; times in s, latencies in us, everything else in SI with the unit beside
// it.
std::string status_json(const Config& config, MonoTime now, const Observation& observation,
                        const CarriedBounds& carried = {});

class StatusServer {
 public:
  // folder empty: nobody can ask.
  explicit StatusServer(const std::string& folder);
  ~StatusServer();
  StatusServer(const StatusServer&) = delete;
  StatusServer& operator=(const StatusServer&) = delete;
  // Why nobody can ask, though there is a folder: one line for the log. Else empty.
  const std::string& error() const { return error_; }
  // Answers all who wait. newest is nullptr before the first sample: then they wait on.
  void turn(const Config& config, MonoTime now, const Observation* newest,
            const CarriedBounds& carried = {});

 private:
  std::string path_, error_;
  int socket_ = -1;
};

}  // namespace beltgrip::daemon
