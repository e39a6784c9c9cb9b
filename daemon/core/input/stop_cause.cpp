#include "daemon/core/input/stop_cause.h"

#include <array>
#include <charconv>
#include <cmath>
#include <string_view>

namespace beltgrip::daemon {

namespace {

// What the reason alone says.
constexpr std::array<std::string_view, estimator::kStopReasonCount> kWords{
    "",
    "friction no longer rises with slip",
    "mu_max is known well enough",
    "too much slip",
    "slip grows too fast",
    "too much slip energy",
    "the request has stood for as long as it may",
    "the force has come to its floor",
    "engine and primary speed no longer go together, or are too low",
    "the torque went to zero, changed its sign or left its band",
    "speeds and torque do not fit the ratio at the end stop",
    "an input was lost, or read what cannot be",
    "permission withdrawn",
    "the driver acted",
    "the bus, or the frames on it",
    "the program was stopped",
    "the log ended",
    "the clamping force does not follow the request",
    "an input stands still",
    "too little slip is left",
    "the clamping force answers later than configured"};

std::string rounded(double value) {
  std::array<char, 32> text;
  const auto end =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, 4);
  return {text.data(), end.ptr};
}

}  // namespace

std::string cause_text(estimator::StopReason reason, const StopCause& cause) {
  std::string text;
  if (cause.role) text = std::string(role_name(*cause.role)) + ": ";
  text += cause.what != nullptr ? std::string_view(cause.what)
                                : kWords.at(static_cast<std::size_t>(reason));
  const std::string unit = *cause.unit == '\0' ? "" : std::string(" ") + cause.unit;
  if (std::isfinite(cause.figure)) text += " " + rounded(cause.figure) + unit;
  if (std::isfinite(cause.limit)) text += ", limit " + rounded(cause.limit) + unit;
  return text;
}

}  // namespace beltgrip::daemon
