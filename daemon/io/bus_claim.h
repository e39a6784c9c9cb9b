// One daemon for a set of identifiers on a bus: a claim among the processes of this host, and a
// time of listening for one elsewhere. Start-up; claims also by the helper thread.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "daemon/core/base/port.h"
#include "daemon/core/config/options/config.h"

namespace beltgrip::daemon {

// Held as long as the object lives, and gone with the process, however it ends.
class BusClaim {
 public:
  // Claims every own identifier on this interface. Sockets without a file bear the claim: their
  // names belong to the network namespace, as the interface does.
  BusClaim(const std::string& interface, const FrameIdentifiers& identifiers);
  ~BusClaim();
  BusClaim(const BusClaim&) = delete;
  BusClaim& operator=(const BusClaim&) = delete;

  // Another process holds it: one line that says what. Where claims cannot be had at all, listening
  // has to do.
  const std::string& refused() const { return refused_; }
  // These beside those that are held, for a reload that waits. False: another process has one of
  // them, refused() says which, and nothing has changed.
  bool add(const FrameIdentifiers& identifiers);
  // These alone, of those that are held: the reload is in force.
  void keep(const FrameIdentifiers& identifiers);

 private:
  std::string interface_;
  std::map<std::string, int> sockets_;  // by identifier
  std::string refused_;
};

// The status frame, at most a second apart, and what a busy sender's clock may add.
inline constexpr Duration kListenBeforeTalk = 1200 * kMillisecond;

struct Listened {
  bool closed = false;                 // stop requested meanwhile
  std::optional<std::uint32_t> heard;  // an own identifier that another node sends with
};
// Takes the port's frames for kListenBeforeTalk, or until one tells.
Listened listen_before_talk(Port& port, const FrameIdentifiers& identifiers);

// "0x6A3", for messages.
std::string identifier_text(std::uint32_t identifier);

}  // namespace beltgrip::daemon
