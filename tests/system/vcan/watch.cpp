#include "tests/system/vcan/watch.h"

#include <algorithm>

namespace beltgrip::test {

bool Watch::take(const ReceivedFrame& seen) {
  last_ns = seen.t_ns;
  return published.take(seen);
}

double Watch::last(const std::string& message, const char* signal) const {
  const auto signals = published.last(message).signals;
  return signals.empty() ? 0.0 : signals.at(signal);
}

bool Watch::until(const BusSocket& bus, const std::function<bool(const Watch&)>& done,
                  Milliseconds limit) {
  return bus
      .receive_until(
          [&](const ReceivedFrame& seen) {
            take(seen);
            return done(*this);
          },
          limit)
      .has_value();
}

bool Watch::pass(const BusSocket& bus, std::int64_t for_ns) {
  const std::int64_t end_ns = last_ns + for_ns;
  return until(bus, [end_ns](const Watch& now) { return now.last_ns >= end_ns; });
}

bool asks(const Watch& watch) { return watch.asking(); }
bool has_value(const Watch& watch) { return watch.estimate("MuMaxValid") == 1.0; }

std::size_t inactive_at_end(const Watch& watch) {
  const std::vector<Published>& all = watch.published.of("BeltGripClamp");
  const auto active = std::find_if(all.rbegin(), all.rend(), [](const Published& frame) {
    return frame.signals.at("RequestActive") == 1.0;
  });
  return static_cast<std::size_t>(active - all.rbegin());
}

std::size_t active_at_end(const Watch& watch) {
  const std::vector<Published>& all = watch.published.of("BeltGripClamp");
  const auto inactive = std::find_if(all.rbegin(), all.rend(), [](const Published& frame) {
    return frame.signals.at("RequestActive") == 0.0;
  });
  return static_cast<std::size_t>(inactive - all.rbegin());
}

}  // namespace beltgrip::test
