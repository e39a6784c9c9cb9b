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
  auto item = std::find_if(ecu->items.begin(), items_end, [&](const Item& each) {
    return each.service == source.service && each.identifier == source.identifier;
  });
  // Without a period there is no polling; the configuration sees to that.
  const auto period = role.period_ms ? Duration::of_ms(*role.period_ms) : kPauseLongest;
  if (item == items_end) {
    ++ecu->item_count;
    item->service = source.service;
    item->identifier = source.identifier;
    item->period = period;
  }
  item->period = std::min(item->period, period);
  item->bytes = std::max(item->bytes, source.bytes);
  item->roles[item->role_count++] = role.role;
}

bool UdsClient::on_frame(const RxFrame& frame, UdsReading& reading) noexcept {
  reading = {};
  rest_ = {};
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
    ecu->asked_count = 0;
    ecu->flow_due = false;
    return false;
  }
  switch (ecu->receiver.on_frame(frame.t.ns(), frame.frame)) {
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
  if (!ecu.is_asked() || ecu.flow_sent) return;
  ecu.flow_due = true;
  ecu.flow = status;
}

void UdsClient::take_message(Ecu& ecu, MonoTime t, UdsReading& reading) noexcept {
  const UdsReply reply = can::parse_uds_reply(ecu.receiver.message());
  switch (reply.kind) {
    case UdsReply::Kind::kData:
      answering_ = &ecu;
      answering_service_ = reply.service;
      take_data(reply.identifier, reply.data, reading);
      return;
    case UdsReply::Kind::kPending:
      if (!ecu.is_asked()) return;
      ecu.give_up_at = std::min(t + kPending, ecu.asked_at + kPendingInAll);
      return;
    case UdsReply::Kind::kNegative:
      ++counters_.refusals;
      counters_.last_code = reply.code;
      if (!ecu.is_asked()) return;
      if (refuses_several(ecu, reply.code)) {
        ecu.alone = true;
        ecu.asked_count = 0;
        ecu.flow_due = false;
        return;
      }
      fail(ecu, t,
           can::uds_refusal(reply.code) == can::UdsRefusal::kEver ? kPauseRefused : Duration{});
      return;
    case UdsReply::Kind::kOther:
      return;
  }
}

bool UdsClient::refuses_several(const Ecu& ecu, std::uint8_t code) noexcept {
  return ecu.asked_count > 1 && can::uds_refusal(code) == can::UdsRefusal::kEver;
}

// Data whose length nobody knows are all that is left.
bool UdsClient::take_data(std::uint16_t identifier, std::span<const std::uint8_t> data,
                          UdsReading& reading) noexcept {
  Ecu& ecu = *answering_;
  const auto end = ecu.items.begin() + ecu.item_count;
  const auto item = std::find_if(ecu.items.begin(), end, [&](const Item& each) {
    return each.service == answering_service_ && each.identifier == identifier;
  });
  rest_ = {};
  if (item == end) return false;
  ++counters_.answers;
  item->pause = {};
  const auto asked = ecu.asked_items();
  if (std::find(asked.begin(), asked.end(), &*item) != asked.end()) ecu.asked_count = 0;
  const std::size_t size =
      item->bytes == 0 ? data.size() : std::min<std::size_t>(item->bytes, data.size());
  rest_ = data.subspan(size);
  reading = {MonoTime::of_ns(ecu.receiver.first_ns()), item->role_list(), data.first(size)};
  return true;
}

bool UdsClient::next(UdsReading& reading) noexcept {
  if (rest_.empty()) return false;
  const auto identifier = can::uds_take_identifier(answering_service_, rest_);
  return identifier && take_data(*identifier, rest_, reading);
}

// The request under way came to nothing.
void UdsClient::fail(Ecu& ecu, MonoTime t, Duration pause_least) noexcept {
  for (Item* each : ecu.asked_items()) {
    Item& item = *each;
    item.pause = std::max(pause_least, std::min(std::max(2 * item.pause, item.period),
                                                std::max(kPauseLongest, item.period)));
    item.due = t + item.pause;
  }
  ecu.asked_count = 0;
  ecu.flow_due = false;
}

void UdsClient::unsent(Ecu& ecu, MonoTime t) noexcept {
  for (Item* each : ecu.asked_items()) each->due = t + kUnsentRetry;
  ecu.asked_count = 0;
  ecu.flow_due = false;
}

void UdsClient::on_send_failed(const can::CanFrame& frame, std::uint8_t bus, MonoTime t) noexcept {
  for (std::size_t i = 0; i < ecu_count_; ++i) {
    Ecu& ecu = ecus_[i];
    if (ecu.bus == bus && ecu.request == frame.id && ecu.is_asked()) unsent(ecu, t);
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
  if (ecu.receiver.expire(t.ns())) ++counters_.broken;
  if (!polls_) return;
  if (ecu.is_asked() && !up) unsent(ecu, t);
  // A long answer has its own time-out from frame to frame, but not for ever.
  const bool late = ecu.receiver.receiving() ? t >= ecu.asked_at + kPending : t >= ecu.give_up_at;
  if (ecu.is_asked() && late) {
    ++counters_.timeouts;
    ecu.receiver.reset();
    fail(ecu, t, {});
  }
  if (ecu.flow_due) {
    outbox.push(can::iso_tp_flow_control(ecu.request, ecu.flow), ecu.bus);
    ecu.flow_due = false;
    ecu.flow_sent = true;
  }
  if (!ecu.is_asked() && t >= ecu.quiet_until) ask(ecu, t, outbox);
}

void UdsClient::ask(Ecu& ecu, MonoTime t, Outbox& outbox) noexcept {
  const auto end = ecu.items.begin() + ecu.item_count;
  const auto item = std::min_element(ecu.items.begin(), end,
                                     [](const Item& a, const Item& b) { return a.due < b.due; });
  if (item == end || item->due > t) return;
  std::array<std::uint16_t, can::UdsRequest::kMost> identifiers{};
  const auto take = [&](Item& each) {
    identifiers[ecu.asked_count] = each.identifier;
    ecu.asked[ecu.asked_count++] = &each;
    // On the grid of its period, unless that has been left behind.
    const bool behind = t - each.due > each.period / 2;
    each.due = (behind ? t : each.due) + each.period;
  };
  const bool together = item->bytes > 0 && !ecu.alone;
  const std::uint8_t service = item->service;
  take(*item);
  for (auto other = ecu.items.begin(); together && other != end; ++other) {
    if (ecu.asked_count == can::identifiers_most(service)) break;
    if (other == item || other->service != service || other->bytes == 0) continue;
    if (other->pause == Duration{} && other->due <= t + other->period / 4) take(*other);
  }
  const can::UdsRequest request =
      can::uds_read_request(service, {identifiers.data(), ecu.asked_count});
  outbox.push(can::iso_tp_single(ecu.request, request.payload()), ecu.bus);
  ++counters_.requests;
  ecu.asked_at = t;
  ecu.give_up_at = t + kAnswer;
  ecu.flow_sent = false;
}

}  // namespace beltgrip::daemon
