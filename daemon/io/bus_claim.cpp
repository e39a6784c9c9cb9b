#include "daemon/io/bus_claim.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstring>

#include "daemon/core/publish/own_frames.h"

namespace beltgrip::daemon {

namespace {

// A datagram socket of this name; -1 with errno.
int claim(const std::string& name) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  // A name that begins with a zero byte stands in no file system.
  if (name.size() + 1 > sizeof address.sun_path) {
    errno = ENAMETOOLONG;
    return -1;
  }
  const int descriptor = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (descriptor < 0) return -1;
  std::memcpy(address.sun_path + 1, name.data(), name.size());
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  if (bind(descriptor, reinterpret_cast<const sockaddr*>(&address), length) == 0) return descriptor;
  const int error = errno;
  close(descriptor);
  errno = error;
  return -1;
}

std::array<std::string, kOwnMessageCount> texts_of(const FrameIdentifiers& identifiers) {
  std::array<std::string, kOwnMessageCount> texts;
  for (std::size_t i = 0; i < texts.size(); ++i) {
    texts[i] = identifier_text(own_identifier(identifiers, static_cast<OwnMessage>(i)));
  }
  return texts;
}

}  // namespace

std::string identifier_text(std::uint32_t identifier) {
  char text[16];
  std::snprintf(text, sizeof text, "0x%03X", identifier);
  return text;
}

BusClaim::BusClaim(const std::string& interface, const FrameIdentifiers& identifiers)
    : interface_(interface) {
  add(identifiers);
}

BusClaim::~BusClaim() {
  for (const auto& [identifier, descriptor] : sockets_) close(descriptor);
}

bool BusClaim::add(const FrameIdentifiers& identifiers) {
  refused_.clear();
  std::map<std::string, int> fresh;
  for (const std::string& text : texts_of(identifiers)) {
    if (sockets_.contains(text)) continue;
    const int descriptor = claim("beltgripd/" + interface_ + "/" + text);
    if (descriptor >= 0) {
      fresh[text] = descriptor;
    } else if (errno == EADDRINUSE) {
      refused_ = "another beltgripd on this host publishes " + text + " on " + interface_ +
                 "; stop it, or give one of them other [bus] identifiers";
      break;
    }
  }
  if (refused_.empty()) {
    sockets_.merge(fresh);
  } else {
    for (const auto& [identifier, descriptor] : fresh) close(descriptor);
  }
  return refused_.empty();
}

void BusClaim::keep(const FrameIdentifiers& identifiers) {
  const auto kept = texts_of(identifiers);
  std::erase_if(sockets_, [&](const auto& each) {
    if (std::find(kept.begin(), kept.end(), each.first) != kept.end()) return false;
    close(each.second);
    return true;
  });
}

Listened listen_before_talk(Port& port, const FrameIdentifiers& identifiers) {
  Listened result;
  std::array<RxFrame, 64> frames;
  const MonoTime end = port.now() + kListenBeforeTalk;
  while (port.now() < end) {
    switch (port.wait_until(end)) {
      case Wake::kDeadline:
        return result;
      case Wake::kClosed:
        result.closed = true;
        return result;
      case Wake::kFrames:
        break;
    }
    const std::size_t count = port.receive(frames);
    for (std::size_t i = 0; i < count; ++i) {
      const RxFrame& seen = frames[i];
      if (seen.bus != 0 || seen.own_echo || seen.frame.error || seen.frame.id.extended) continue;
      for (std::size_t own = 0; own < kOwnMessageCount; ++own) {
        if (seen.frame.id.value != own_identifier(identifiers, static_cast<OwnMessage>(own))) {
          continue;
        }
        result.heard = seen.frame.id.value;
        return result;
      }
    }
  }
  return result;
}

}  // namespace beltgrip::daemon
