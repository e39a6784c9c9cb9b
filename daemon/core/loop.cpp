#include "daemon/core/loop.h"

#include <array>
#include <cmath>

namespace beltgrip::daemon {

namespace {

constexpr std::size_t kBatch = 64;
// Samples that are later than this are given up: the socket's buffer may not have held their
// frames.
constexpr Duration kLatenessMaximum = 100 * kMillisecond;

class Loop {
 public:
  Loop(Port& port, Pipeline& pipeline, double sample_rate_hz, SampleSink* sink) noexcept
      : port_(port),
        pipeline_(pipeline),
        sink_(sink),
        period_(std::llround(static_cast<double>(kSecond) / sample_rate_hz)),
        next_(port.now()) {}

  LoopCounters run(estimator::StopReason end_reason) noexcept {
    for (;;) {
      switch (port_.wait_until(next_)) {
        case Wake::kDeadline:
          sample();
          break;
        case Wake::kFrames:
          receive();
          break;
        case Wake::kClosed:
          end(end_reason);
          return counters_;
      }
    }
  }

 private:
  void receive() noexcept {
    const std::size_t count = port_.receive(frames_);
    // A port that announces frames and has none must not keep the samples from their turn.
    if (count == 0 && port_.now() >= next_) sample();
    for (std::size_t i = 0; i < count; ++i) {
      // A frame that came after a sample's instant is not seen by that sample, however late it is.
      while (frames_[i].t > next_) sample();
      pipeline_.on_frame(frames_[i]);
    }
  }

  void sample() noexcept {
    const MonoTime now = port_.now();
    const Duration lateness = now - next_;
    if (lateness > kLatenessMaximum) {
      const std::int64_t lost = lateness / period_;
      next_ += lost * period_;
      counters_.samples_late += static_cast<std::uint64_t>(lost);
      pipeline_.on_late(next_, true);
    } else if (lateness > period_) {
      ++counters_.samples_late;
      pipeline_.on_late(next_, false);
    }
    const BusState state = port_.bus_state();
    if (state != bus_state_) pipeline_.on_bus_state(state, next_);
    bus_state_ = state;

    outbox_.size = 0;
    const SampleReport& report = pipeline_.on_sample(next_, outbox_);
    send();
    if (sink_ != nullptr) sink_->on_report(report);
    next_ += period_;
  }

  void end(estimator::StopReason reason) noexcept {
    outbox_.size = 0;
    const SampleReport& report = pipeline_.on_end(port_.now(), reason, outbox_);
    send();
    if (sink_ != nullptr) sink_->on_report(report);
  }

  void send() noexcept {
    for (std::size_t i = 0; i < outbox_.size; ++i) {
      const SendResult result = port_.send(outbox_.frames[i]);
      if (result == SendResult::kSent) continue;
      ++counters_.sends_failed;
      // A link that is down has a fault of its own.
      if (result != SendResult::kDown) pipeline_.on_send_failed(outbox_.frames[i], next_);
    }
  }

  Port& port_;
  Pipeline& pipeline_;
  SampleSink* sink_;
  Duration period_;
  MonoTime next_;
  BusState bus_state_ = BusState::kActive;
  LoopCounters counters_;
  Outbox outbox_;
  std::array<RxFrame, kBatch> frames_{};
};

}  // namespace

LoopCounters run_loop(Port& port, Pipeline& pipeline, double sample_rate_hz,
                      estimator::StopReason end_reason, SampleSink* sink) noexcept {
  return Loop(port, pipeline, sample_rate_hz, sink).run(end_reason);
}

}  // namespace beltgrip::daemon
