// What the flight recorder keeps: everything that the pipeline is told, in the order in which it is
// told, so that the same pipeline decides the same again. Frames; and beside them only what their
// stamps do not say: samples that were taken late, the state of the bus, frames that could not be
// sent, what the history has learned. Plain data through a ring; a full one drops and counts.
// Real-time thread.
#pragma once

#include <cstdint>

#include "daemon/core/base/port.h"
#include "daemon/core/base/spsc_ring.h"
#include "daemon/core/loop/pipeline.h"

namespace beltgrip::daemon {

// Of a sample t is when it was due.
enum class RecordKind : std::uint8_t {
  kStart,    // the first sample will be at t
  kFrame,    // frame, own_echo; `number` were lost before it
  kAfter,    // frames that follow came after the sample at t - 1 ns, whatever their stamps say
  kLate,     // the sample at t was taken at `now`
  kBus,      // from the sample at t on: state of bus
  kFailed,   // a frame of identifier `number` could not be sent on bus by the sample at t: sent
  kLearned,  // after the sample at t; the value is in the other ring
  kMark,     // sample at t: in_experiment, faults in `number`; on a change, and now and then
  kReload,   // after the sample at t another configuration is in force
  kEnd       // after the sample at t - 1 ns the loop ended, at `now`
};

struct RecordItem {
  MonoTime t = MonoTime::origin();
  MonoTime now = MonoTime::origin();
  RecordKind kind = RecordKind::kMark;
  bool in_experiment = false;
  bool own_echo = false;
  std::uint8_t bus = 0;
  BusState state = BusState::kActive;
  SendResult sent = SendResult::kSent;
  std::uint32_t number = 0;
  can::CanFrame frame = {};
};

struct RecordRings {
  SpscRing<RecordItem, 8192> items;
  SpscRing<estimator::LearnedFriction, 16> learned;
};

class RecordTap {
 public:
  static constexpr int kMarkSamples = 100;

  explicit RecordTap(RecordRings& rings) : rings_(rings) {}

  void start(MonoTime first) noexcept { push({.t = first, .kind = RecordKind::kStart}); }
  void frame(const RxFrame& frame) noexcept;
  void late(MonoTime t, MonoTime now) noexcept {
    push({.t = t, .now = now, .kind = RecordKind::kLate});
  }
  void bus(MonoTime t, std::uint8_t bus, BusState state) noexcept {
    push({.t = t, .kind = RecordKind::kBus, .bus = bus, .state = state});
  }
  void failed(MonoTime t, std::uint8_t bus, std::uint32_t id, SendResult result) noexcept {
    push({.t = t, .kind = RecordKind::kFailed, .bus = bus, .sent = result, .number = id});
  }
  void learned(MonoTime t, const estimator::LearnedFriction& learned) noexcept;
  void sampled(const SampleReport& report) noexcept;
  void reloaded(MonoTime t) noexcept { push({.t = t, .kind = RecordKind::kReload}); }
  void end(MonoTime now) noexcept {
    push({.t = sampled_ + kNanosecond, .now = now, .kind = RecordKind::kEnd});
  }

 private:
  void push(const RecordItem& item) noexcept { rings_.items.push(item); }

  RecordRings& rings_;
  MonoTime sampled_;  // the newest sample
  MonoTime after_;    // the newest kAfter
  bool in_experiment_ = false;
  std::uint32_t faults_ = 0;
  int left_ = 0;
};

}  // namespace beltgrip::daemon
