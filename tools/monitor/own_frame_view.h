// BeltGrip's own frames as a person or a script sees them: decoded through beltgrip.dbc, protection
// checked, as JSON lines or as a table that grows when something changes. Tools only.
#pragma once

#include <cstdint>
#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "can_dbc/dbc/message_codec.h"
#include "can_dbc/dbc/model.h"
#include "can_dbc/frame/can_frame.h"
#include "can_dbc/frame/e2e.h"
#include "daemon/core/config/options/config.h"

namespace beltgrip::monitor {

struct OwnFrameView {
  const can::MessageDef* message = nullptr;
  can::DecodedMessage signals;  // in the definition's order
  can::e2e::CheckStatus check = can::e2e::CheckStatus::kOk;

  bool good() const {
    return check == can::e2e::CheckStatus::kOk || check == can::e2e::CheckStatus::kOkSomeLost;
  }
  double value(std::string_view signal) const;
  // Text of the value table; empty where the raw value has none.
  std::string label(std::string_view signal) const;
};

class OwnFrameDecoder {
 public:
  explicit OwnFrameDecoder(const daemon::FrameIdentifiers& identifiers);
  // Nothing for frames that are not BeltGrip's.
  std::optional<OwnFrameView> decode(const can::CanFrame& frame);
  // The next frame of each message may have any counter.
  void begin_anew();

 private:
  struct Message {
    const can::MessageDef* definition;
    can::MessageCodec codec;
    can::e2e::Checker checker;
  };
  std::map<std::uint32_t, Message> messages_;
};

std::string json_line(std::int64_t t_ns, const OwnFrameView& view);

// The table: a row every half second of the bus's time while something goes on, every two seconds
// else, and one for a change of state, stop flag or result, and for the peak before the stop.
// Frames that say one change together make one row.
class BusTable {
 public:
  explicit BusTable(std::FILE* out) : out_(out) {}
  // t_ns as shown.
  void on_frame(std::int64_t t_ns, const OwnFrameView& view);

 private:
  struct Picture {
    std::string state = "-", asks = "-", phase = "-", mu_star = "-", sigma = "-", slope = "-",
                stop = "-", mu_max = "-", force = "-";
    // What is worth a row of its own.
    bool differs(const Picture& other) const {
      return state != other.state || stop != other.stop || mu_max != other.mu_max ||
             (stop == "-" && phase != other.phase && (phase == "peak" || phase == "macro slip"));
    }
    // Nothing goes on: no experiment, and none about to begin.
    bool calm() const { return state == "inhibited" || state == "idle" || state == "cooldown"; }
  };
  void row(std::int64_t t_ns);

  std::FILE* out_;
  Picture now_, shown_;
  std::optional<std::int64_t> last_row_ns_;
  std::optional<std::int64_t> change_ns_;  // waits for what belongs to it
  std::uint64_t rows_ = 0;
};

}  // namespace beltgrip::monitor
