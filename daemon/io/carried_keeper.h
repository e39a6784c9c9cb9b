// Keeps what was carried without slip over all drives: one small JSON file beside the history, by
// the configuration's fingerprint, written whole and renamed. A file that cannot be read is set
// aside; one that cannot be written is tried again a minute later. Start-up, then helper thread;
// and tools.
#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "daemon/core/base/result.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/observe/carried_record.h"

namespace beltgrip::daemon {

inline constexpr const char* kCarriedFile = "carried.json";

// The groups of which something is known, with what is shown of each.
nlohmann::ordered_json carried_json(const CarriedBounds& bounds);
std::string carried_json_text(const CarriedBounds& bounds);

// What the file in this folder has of a configuration, or with an empty fingerprint of the one that
// was written last; nothing known where there is no file. Text: what is wrong with it.
Result<CarriedBounds> read_carried(const std::string& folder, const std::string& fingerprint);

class CarriedKeeper {
 public:
  static constexpr double kWrite_s = 60.0;
  // Chosen: below it a higher bound is not worth a line of the log.
  static constexpr double kNews = 0.01;
  using Say = std::function<void(bool warning, const std::string& line)>;

  // Empty folder: nothing is kept beyond the end.
  CarriedKeeper(std::string folder, const Config& config, Say say);
  ~CarriedKeeper();  // writes what is not written yet
  CarriedKeeper(const CarriedKeeper&) = delete;
  CarriedKeeper& operator=(const CarriedKeeper&) = delete;

  void take(const CarriedWindow& window, double time_s);
  // Another configuration is in force.
  void change(const Config& config);
  // Writes at most once in kWrite_s. Unix time.
  void turn(double now_s);
  // False: it could not be written.
  bool write();
  const CarriedBounds& bounds() const { return record_.bounds(); }

 private:
  void open();

  std::string folder_, fingerprint_;
  CarriedRecord record_;
  Say say_;
  CarriedBounds said_{};
  bool unwritten_ = false;
  bool complained_ = false;
  double written_s_ = 0.0;
};

}  // namespace beltgrip::daemon
