// Signals from diagnostics: one ISO-TP receiver for each ECU, the answers to ReadDataByIdentifier
// out of it, and, where the configuration allows it (bus.diagnostics = "poll"), the requests for
// them. Frames and time in, frames out: no clock, no I/O, fixed memory after construction.
// Real-time thread; replay uses the same object.
//
// Listening: every positive answer of a configured identifier counts, whoever asked for it, stamped
// with the arrival of its first frame. Polling adds:
//   - one request under way to an ECU; of its identifiers the one that has been due longest, and
//     together with it, where the lengths of their data are known, others that are due; an ECU that
//     refuses several at once is asked for one at a time
//   - the next request when the answer has come and its time is due (period_ms); "pending" (0x78)
//     gives the ECU 5 s from then on, 30 s in all
//   - a refusal or no answer in 150 ms costs a pause of that identifier, from its period doubling
//     up to 5 s; a refusal that will stand (can::UdsRefusal::kEver) 60 s; an answer ends it
//   - while the bus is down or full, a try every 200 ms: a bus may tell only thus that it is back
//   - another tester on the same request identifier has the right of way: nothing is sent there
//     until its last request is 5 s old (longer than its session can outlive it)
//   - of a long answer the flow control "continue", once for each request
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>

#include "can_dbc/uds/iso_tp.h"
#include "can_dbc/uds/uds.h"
#include "daemon/core/base/outbox.h"
#include "daemon/core/base/port.h"
#include "daemon/core/config/options/config.h"

namespace beltgrip::daemon {

// The data of one identifier, and the roles whose value it holds. Valid until the next frame.
struct UdsReading {
  MonoTime t = MonoTime::origin();
  std::span<const Role> roles;
  std::span<const std::uint8_t> data;
};

struct UdsCounters {
  std::uint64_t requests = 0;  // handed to be sent
  std::uint64_t answers = 0;   // with a value
  std::uint64_t refusals = 0;  // negative, but not pending
  std::uint64_t timeouts = 0;  // of our requests
  std::uint64_t broken = 0;    // messages that ended halfway
  std::uint64_t foreign = 0;   // frames of another tester
  std::uint8_t last_code = 0;  // of the last refusal
};

class UdsClient {
 public:
  static constexpr Duration kAnswer = 150 * kMillisecond;
  static constexpr Duration kPending = 5 * kSecond;
  static constexpr Duration kPendingInAll = 30 * kSecond;
  static constexpr Duration kPauseLongest = 5 * kSecond;
  static constexpr Duration kPauseRefused = 60 * kSecond;
  static constexpr Duration kForeignQuiet = 5 * kSecond;
  static constexpr Duration kUnsentRetry = 200 * kMillisecond;

  explicit UdsClient(const Config& config);

  // True when the frame is part of an ECU's answer; with a reading when it completes one.
  bool on_frame(const RxFrame& frame, UdsReading& reading) noexcept;
  // The next identifier of the same answer.
  bool next(UdsReading& reading) noexcept;
  // What is to be sent at t; `up` says which buses carry frames. Each call later than the one
  // before.
  void step(MonoTime t, const std::array<bool, kBusMax>& up, Outbox& outbox) noexcept;
  // This frame of the last step was not sent.
  void on_send_failed(const can::CanFrame& frame, std::uint8_t bus, MonoTime t) noexcept;
  const UdsCounters& counters() const noexcept { return counters_; }

 private:
  struct Item {
    std::uint8_t service = 0;
    std::uint16_t identifier = 0;
    std::uint16_t bytes = 0;  // of data; 0: not known
    std::array<Role, kRoleCount> roles{};
    std::uint8_t role_count = 0;
    Duration period = Duration::zero();
    Duration pause = Duration::zero();  // after a failure; 0: all is well
    MonoTime due = MonoTime::origin();
    std::span<const Role> role_list() const noexcept { return {roles.data(), role_count}; }
  };
  struct Ecu {
    std::uint8_t bus = 0;
    can::CanId request, response;
    can::IsoTpReceiver receiver;
    std::array<Item, kRoleCount> items;
    std::uint8_t item_count = 0;
    std::array<Item*, can::UdsRequest::kMost> asked{};  // of the request under way
    std::uint8_t asked_count = 0;
    bool alone = false;  // refuses several at once
    bool is_asked() const noexcept { return asked_count > 0; }
    std::span<Item* const> asked_items() const noexcept { return {asked.data(), asked_count}; }
    MonoTime asked_at = MonoTime::origin();
    MonoTime give_up_at = MonoTime::origin();
    MonoTime quiet_until = MonoTime::min();  // another tester is there
    bool flow_due = false;
    bool flow_sent = false;  // for this request
    can::FlowStatus flow = can::FlowStatus::kContinue;
  };

  void add(const RoleBinding& role, const UdsSource& source);
  void take_message(Ecu& ecu, MonoTime t, UdsReading& reading) noexcept;
  bool take_data(std::uint16_t identifier, std::span<const std::uint8_t> data,
                 UdsReading& reading) noexcept;
  static bool refuses_several(const Ecu& ecu, std::uint8_t code) noexcept;
  void want_flow(Ecu& ecu, can::FlowStatus status) noexcept;
  void step(Ecu& ecu, MonoTime t, bool up, Outbox& outbox) noexcept;
  void ask(Ecu& ecu, MonoTime t, Outbox& outbox) noexcept;
  static void fail(Ecu& ecu, MonoTime t, Duration pause_least) noexcept;
  static void unsent(Ecu& ecu, MonoTime t) noexcept;

  bool polls_;
  bool started_ = false;
  std::array<Ecu, kRoleCount> ecus_;
  std::uint8_t ecu_count_ = 0;
  // What is left of an answer with several identifiers.
  Ecu* answering_ = nullptr;
  std::uint8_t answering_service_ = 0;
  std::span<const std::uint8_t> rest_;
  UdsCounters counters_;
};

}  // namespace beltgrip::daemon
