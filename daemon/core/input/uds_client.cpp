#include "daemon/core/input/uds_client.h"

#include <algorithm>

namespace beltgrip::daemon {

using can::FlowStatus;
using can::UdsReply;
using Event = can::IsoTpReceiver::Event;

UdsClient::UdsClient(const Config& config) : polls_(config.diagnostics == Diagnostics::kPoll) {
  for (const RoleBinding& role : config.roles) {
    if (role.uds) add(role, *role.uds);
  }
}

void UdsClient::add(const RoleBinding& role, const UdsSource& source) {
  const auto ecus_end = ecus_.begin() + ecu_count_;
  auto ecu = std::find_if(ecus_.begin(), ecus_end, [&](const Ecu& each) {
    return each.bus == role.bus && each.response == source.response;
  });
  if (ecu == ecus_end) {
    ++ecu_count_;
    ecu->bus = role.bus;
    ecu->request = source.request;
    ecu->response = source.response;
  }
  const auto items_end = ecu->items.begin() + ecu->item_count;
  auto item = std::find_if(ecu->items.begin(), items_end,
                           [&](const Item& each) { return each.identifier == source.identifier; });
  // Without a period there is no polling; the configuration sees to that.
  const auto period = static_cast<Duration>(role.period_ms.value_or(kPauseLongest / kMillisecond) *
                                            static_cast<double>(kMillisecond));
  if (item == items_end) {
    ++ecu->item_count;
    item->identifier = source.identifier;
    item->period = period;
  }
  item->period = std::min(item->period, period);
  item->roles[item->role_count++] = role.role;
}

bool UdsClient::on_frame(const RxFrame& frame, UdsReading& reading) noexcept {
  reading = {};
  if (frame.frame.error || frame.frame.remote) return false;
  const auto ecus_end = ecus_.begin() + ecu_count_;
  const auto ecu = std::find_if(ecus_.begin(), ecus_end, [&](const Ecu& each) {
    return each.bus == frame.bus &&
           (each.response == frame.frame.id || each.request == frame.frame.id);
  });
  if (ecu == ecus_end) return false;
  if (ecu->request == frame.frame.id) {
    if (frame.own_echo) return false;
    ++counters_.foreign;
    ecu->quiet_until = frame.t + kForeignQuiet;
    ecu->asked = nullptr;
    ecu->flow_due = false;
    return false;
  }
  switch (ecu->receiver.on_frame(frame.t, frame.frame)) {
    case Event::kMessage:
      take_message(*ecu, frame.t, reading);
      break;
    case Event::kFirst:
      want_flow(*ecu, FlowStatus::kContinue);
      break;
    case Event::kTooLong:
      want_flow(*ecu, FlowStatus::kOverflow);
      break;
    case Event::kBroken:
      ++counters_.broken;
      break;
    case Event::kContinued:
    case Event::kIgnored:
      break;
  }
  return true;
}

void UdsClient::want_flow(Ecu& ecu, FlowStatus status) noexcept {
  if (ecu.asked == nullptr || ecu.flow_sent) return;
  ecu.flow_due = true;
  ecu.flow = status;
}

void UdsClient::take_message(Ecu& ecu, MonoTime t, UdsReading& reading) noexcept {
  const UdsReply reply = can::parse_uds_reply(ecu.receiver.message());
  switch (reply.kind) {
    case UdsReply::Kind::kData: {
      const auto end = ecu.items.begin() + ecu.item_count;
      const auto item = std::find_if(ecu.items.begin(), end, [&](const Item& each) {
        return each.identifier == reply.identifier;
      });
      if (item == end) return;
      ++counters_.answers;
      item->pause = 0;
      if (ecu.asked == &*item) ecu.asked = nullptr;
      reading = {ecu.receiver.first_ns(), item->role_list(), reply.data};
      return;
    }
    case UdsReply::Kind::kPending:
      if (ecu.asked == nullptr) return;
      ecu.give_up_at = std::min(t + kPending, ecu.asked_at + kPendingInAll);
      return;
    case UdsReply::Kind::kNegative:
      ++counters_.refusals;
      counters_.last_code = reply.code;
      if (ecu.asked == nullptr) return;
      fail(ecu, t,
           can::uds_refusal(reply.code) == can::UdsRefusal::kEver ? kPauseRefused : Duration{0});
      return;
    case UdsReply::Kind::kOther:
      return;
  }
}

// The request under way came to nothing.
void UdsClient::fail(Ecu& ecu, MonoTime t, Duration pause_least) noexcept {
  Item& item = *ecu.asked;
  item.pause = std::max(pause_least, std::min(std::max(2 * item.pause, item.period),
                                              std::max(kPauseLongest, item.period)));
  item.due = t + item.pause;
  ecu.asked = nullptr;
  ecu.flow_due = false;
}

void UdsClient::unsent(Ecu& ecu, MonoTime t) noexcept {
  ecu.asked->due = t + kUnsentRetry;
  ecu.asked = nullptr;
  ecu.flow_due = false;
}

void UdsClient::on_send_failed(const can::CanFrame& frame, std::uint8_t bus, MonoTime t) noexcept {
  for (std::size_t i = 0; i < ecu_count_; ++i) {
    Ecu& ecu = ecus_[i];
    if (ecu.bus == bus && ecu.request == frame.id && ecu.asked != nullptr) unsent(ecu, t);
  }
}

void UdsClient::step(MonoTime t, const std::array<bool, kBusMax>& up, Outbox& outbox) noexcept {
  for (std::size_t i = 0; i < ecu_count_; ++i) step(ecus_[i], t, up[ecus_[i].bus], outbox);
  started_ = true;
}

void UdsClient::step(Ecu& ecu, MonoTime t, bool up, Outbox& outbox) noexcept {
  if (!started_) {
    for (std::size_t i = 0; i < ecu.item_count; ++i) ecu.items[i].due = t;
  }
  if (ecu.receiver.expire(t)) ++counters_.broken;
  if (!polls_) return;
  if (ecu.asked != nullptr && !up) unsent(ecu, t);
  // A long answer has its own time-out from frame to frame, but not for ever.
  const bool late = ecu.receiver.receiving() ? t >= ecu.asked_at + kPending : t >= ecu.give_up_at;
  if (ecu.asked != nullptr && late) {
    ++counters_.timeouts;
    ecu.receiver.reset();
    fail(ecu, t, 0);
  }
  if (ecu.flow_due) {
    outbox.push(can::iso_tp_flow_control(ecu.request, ecu.flow), ecu.bus);
    ecu.flow_due = false;
    ecu.flow_sent = true;
  }
  if (ecu.asked == nullptr && t >= ecu.quiet_until) ask(ecu, t, outbox);
}

void UdsClient::ask(Ecu& ecu, MonoTime t, Outbox& outbox) noexcept {
  const auto end = ecu.items.begin() + ecu.item_count;
  const auto item = std::min_element(ecu.items.begin(), end,
                                     [](const Item& a, const Item& b) { return a.due < b.due; });
  if (item == end || item->due > t) return;
  const auto request = can::uds_read_request(item->identifier);
  outbox.push(can::iso_tp_single(ecu.request, request), ecu.bus);
  ++counters_.requests;
  // On the grid of its period, unless that has been left behind.
  const bool behind = t - item->due > item->period / 2;
  item->due = (behind ? t : item->due) + item->period;
  ecu.asked = &*item;
  ecu.asked_at = t;
  ecu.give_up_at = t + kAnswer;
  ecu.flow_sent = false;
}

}  // namespace beltgrip::daemon
