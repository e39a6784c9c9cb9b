// The frames that BeltGrip published, as another node sees them: layout read from the text of
// beltgrip.dbc, protection recalculated bit by bit, none of the program's own code.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tests/system/vcan/vcan_fixture.h"

namespace beltgrip::test {

struct Published {
  std::int64_t t_ns = 0;
  std::map<std::string, double> signals;
};

class PublishedFrames {
 public:
  enum class Control { kObserve, kCommand };
  // Reads can_dbc/beltgrip.dbc.
  explicit PublishedFrames(Control control = Control::kObserve);

  // Frames in order of arrival; those of other nodes are passed over. True if it was one of ours.
  bool take(const ReceivedFrame& seen);
  const std::vector<Published>& of(const std::string& message) const { return frames_.at(message); }
  // The last one, or none of its signals when there was none.
  Published last(const std::string& message) const;
  // What is wrong with them: kind, length, CRC, counter, in observe a clamp frame. Empty is right.
  const std::vector<std::string>& problems() const { return problems_; }
  // The next frame of each message may have any counter (after frames were lost on purpose).
  void forget_counters() { counters_.clear(); }

 private:
  struct Signal {
    std::string name;
    unsigned start = 0, length = 0;
    bool is_signed = false;
    double scale = 1.0, offset = 0.0;
  };
  struct Message {
    std::string name;
    std::vector<Signal> signals;
  };
  Control control_;
  std::map<canid_t, Message> messages_;
  std::map<std::string, std::vector<Published>> frames_;
  std::map<canid_t, unsigned> counters_;
  std::vector<std::string> problems_;
};

}  // namespace beltgrip::test
