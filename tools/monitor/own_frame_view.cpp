#include "tools/monitor/own_frame_view.h"

#include <cmath>

#include "daemon/core/publish/own_frames.h"
#include "tools/text/json_writer.h"
#include "tools/text/seconds.h"
#include "tools/text/snake_case.h"

namespace beltgrip::monitor {

namespace {

constexpr std::int64_t kRowPeriod_ns = 500'000'000;
constexpr std::int64_t kCalmPeriod_ns = 2'000'000'000;
constexpr std::int64_t kTogether_ns = 3'000'000;
constexpr std::uint64_t kRowsPerHeader = 50;
constexpr std::uint8_t kMaxDelta = 3;  // frames that may be lost in a row, plus one

std::size_t index_of(const can::MessageDef& message, std::string_view signal) {
  return static_cast<std::size_t>(message.find_signal(signal) - message.signals.data());
}

const char* check_text(can::e2e::CheckStatus check) {
  switch (check) {
    case can::e2e::CheckStatus::kOk:
      return "ok";
    case can::e2e::CheckStatus::kOkSomeLost:
      return "ok_some_lost";
    case can::e2e::CheckStatus::kRepeated:
      return "repeated";
    case can::e2e::CheckStatus::kWrongSequence:
      return "wrong_sequence";
    case can::e2e::CheckStatus::kWrongCrc:
      return "wrong_crc";
  }
  return "";
}

std::string fixed(const OwnFrameView& view, const char* signal, int decimals) {
  if (view.label(signal) == "NotAvailable") return "-";
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.*f", decimals, view.value(signal));
  return buffer;
}

std::string lower(const std::string& label) {
  std::string text = text::snake_case(label);
  for (char& c : text) {
    if (c == '_') c = ' ';
  }
  return text;
}

}  // namespace

double OwnFrameView::value(std::string_view signal) const {
  return signals[index_of(*message, signal)].physical;
}

std::string OwnFrameView::label(std::string_view signal) const {
  const std::size_t index = index_of(*message, signal);
  const auto& values = message->signals[index].values;
  const auto found = values.find(static_cast<std::int64_t>(signals[index].raw));
  return found == values.end() ? std::string() : found->second;
}

OwnFrameDecoder::OwnFrameDecoder(const daemon::FrameIdentifiers& identifiers) {
  constexpr const char* kNames[] = {"BeltGripEstimate", "BeltGripSlip", "BeltGripClamp",
                                    "BeltGripStatus"};
  for (std::size_t i = 0; i < daemon::kOwnMessageCount; ++i) {
    const auto own = static_cast<daemon::OwnMessage>(i);
    const can::MessageDef* definition = daemon::own_database().find_message(kNames[i]);
    messages_.emplace(daemon::own_identifier(identifiers, own),
                      Message{definition, can::MessageCodec(*definition),
                              can::e2e::Checker(daemon::own_data_id(own), kMaxDelta)});
  }
}

std::optional<OwnFrameView> OwnFrameDecoder::decode(const can::CanFrame& frame) {
  const auto found = messages_.find(frame.id.value);
  if (found == messages_.end() || frame.id.extended || frame.remote || frame.error || frame.fd ||
      frame.length != daemon::kOwnFrameLength) {
    return std::nullopt;
  }
  Message& message = found->second;
  OwnFrameView view;
  view.message = message.definition;
  view.signals = can::DecodedMessage(message.codec.signal_count());
  message.codec.decode(frame.payload(), view.signals);
  view.check = message.checker.check(frame);
  return view;
}

void OwnFrameDecoder::begin_anew() {
  for (auto& [identifier, message] : messages_) message.checker.reset();
}

std::string json_line(std::int64_t t_ns, const OwnFrameView& view) {
  text::JsonWriter json;
  json.begin_object()
      .key("t_s")
      .raw(text::seconds_text(t_ns))
      .field("message", view.message->name)
      .field("protection", check_text(view.check))
      .key("signals")
      .begin_object();
  for (std::size_t i = 0; i < view.signals.size(); ++i) {
    json.field(view.message->signals[i].name, view.signals[i].physical);
  }
  json.end_object().key("labels").begin_object();
  for (const can::SignalDef& signal : view.message->signals) {
    const std::string label = view.label(signal.name);
    if (!label.empty()) json.field(signal.name, label);
  }
  json.end_object().end_object();
  return json.take() + "\n";
}

void BusTable::on_frame(std::int64_t t_ns, const OwnFrameView& view) {
  if (!view.good()) {
    std::fprintf(out_, "%9.3f s   %s: %s\n", static_cast<double>(t_ns) * 1e-9,
                 std::string(view.message->name).c_str(), check_text(view.check));
    return;
  }
  if (change_ns_ && t_ns - *change_ns_ > kTogether_ns) row(*change_ns_);
  const std::string& name = view.message->name;
  if (name == "BeltGripSlip") {
    now_.phase = lower(view.label("Phase"));
    now_.stop = view.value("MacroSlipStop") > 0.5 ? "STOP" : "-";
    now_.mu_star = fixed(view, "MuStar", 4);
    now_.sigma = fixed(view, "SigmaStar", 2);
    now_.slope = fixed(view, "FrictionSlope", 4);
  } else if (name == "BeltGripEstimate") {
    const std::string kind = view.label("MuMaxKind");
    if (kind == "Value") {
      now_.mu_max = fixed(view, "MuMax", 4) + " std " + fixed(view, "MuMaxStd", 4);
    } else {
      now_.mu_max = kind == "LowerBound" ? "at least " + fixed(view, "MuMax", 4) : "-";
    }
    now_.force = fixed(view, "MinClampForce", 0);
  } else if (name == "BeltGripClamp") {
    now_.asks = view.value("RequestActive") > 0.5 ? fixed(view, "SecondaryForce", 0) : "-";
  } else if (name == "BeltGripStatus") {
    now_.state = lower(view.label("State"));
  }
  const bool due =
      !last_row_ns_ || t_ns - *last_row_ns_ >= (now_.calm() ? kCalmPeriod_ns : kRowPeriod_ns);
  if (!change_ns_ && (due || now_.differs(shown_))) change_ns_ = t_ns;
}

void BusTable::row(std::int64_t t_ns) {
  if (rows_++ % kRowsPerHeader == 0) {
    std::fprintf(out_, "%11s  %-11s %6s  %-11s %7s %7s %9s  %-5s %-18s %s\n", "time", "state",
                 "asks N", "phase", "mu*", "slip %", "slope 1/%", "stop", "mu_max", "min clamp N");
  }
  std::fprintf(out_, "%9.3f s  %-11s %6s  %-11s %7s %7s %9s  %-5s %-18s %s\n",
               static_cast<double>(t_ns) * 1e-9, now_.state.c_str(), now_.asks.c_str(),
               now_.phase.c_str(), now_.mu_star.c_str(), now_.sigma.c_str(), now_.slope.c_str(),
               now_.stop.c_str(), now_.mu_max.c_str(), now_.force.c_str());
  std::fflush(out_);
  shown_ = now_;
  last_row_ns_ = t_ns;
  change_ns_.reset();
}

}  // namespace beltgrip::monitor
