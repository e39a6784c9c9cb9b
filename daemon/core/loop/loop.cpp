#include "daemon/core/loop/loop.h"

#include <array>
#include <cmath>

namespace beltgrip::daemon {

namespace {

constexpr std::size_t kBatch = 64;
// Samples that are later than this are given up: the socket's buffer may not have held their
// frames, and the receiver of a request gives it up after 50 ms of silence.
constexpr Duration kLatenessMaximum = 45 * kMillisecond;
// A silence is followed until nothing has changed for so long, and again from so long before its
// end.
constexpr Duration kAtRest = kSecond;
constexpr Duration kBeforeTheEnd = kSecond / 2;

class Loop {
 public:
  Loop(Port& port, Pipeline& pipeline, double sample_rate_hz, SampleSink* sink, LoopMeters* meters,
       RecordTap* tap, const Exchange& exchange) noexcept
      : port_(port),
        pipeline_(pipeline),
        sink_(sink),
        meters_(meters),
        tap_(tap),
        exchange_(exchange),
        period_(period_of(sample_rate_hz)),
        next_(port.now()),
        buses_(static_cast<std::uint8_t>(pipeline.bus_count())) {
    if (tap_ != nullptr) tap_->start(next_);
  }

  LoopCounters run(estimator::StopReason end_reason) noexcept {
    for (;;) {
      switch (port_.wait_until(next_)) {
        case Wake::kDeadline:
          if (meters_ != nullptr) meters_->wake_up.add(port_.now() - next_);
          sample();
          leave_out_silence();
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
    const MonoTime taken = meters_ != nullptr ? port_.now() : MonoTime{};
    for (std::size_t i = 0; i < count; ++i) {
      if (meters_ != nullptr) meters_->frame_age.add(taken - frames_[i].t);
      // A frame that came after a sample's instant is not seen by that sample, however late it is.
      while (frames_[i].t > next_) sample();
      if (!frames_[i].own_echo) changed_ = next_;
      if (tap_ != nullptr) tap_->frame(frames_[i]);
      pipeline_.on_frame(frames_[i]);
    }
  }

  void sample() noexcept {
    const MonoTime now = port_.now();
    const Duration lateness = now - next_;
    due_ = next_;
    if (tap_ != nullptr && lateness > period_) tap_->late(due_, now);
    if (lateness > kLatenessMaximum) {
      const std::int64_t lost = lateness / period_;
      next_ += lost * period_;
      counters_.samples_late += static_cast<std::uint64_t>(lost);
      pipeline_.on_late(next_, true);
    } else if (lateness > period_) {
      ++counters_.samples_late;
      pipeline_.on_late(next_, false);
    }
    for (std::uint8_t bus = 0; bus < buses_; ++bus) {
      const BusState state = port_.bus_state_of(bus);
      if (state == bus_states_[bus]) continue;
      if (tap_ != nullptr) tap_->bus(due_, bus, state);
      pipeline_.on_bus_state(state, next_, bus);
      bus_states_[bus] = state;
    }

    outbox_.size = 0;
    const SampleReport& report = pipeline_.on_sample(next_, outbox_);
    send();
    if (meters_ != nullptr) {
      if (outbox_.size != 0) meters_->sample_to_frame.add(port_.now() - next_);
      meters_->counters = counters_;
    }
    if (tap_ != nullptr) tap_->sampled(report);
    if (sink_ != nullptr) sink_->on_report(report);
    watch();
    hand_out_result();
    learn();
    reload();
    next_ += period_;
  }

  void watch() noexcept {
    const Pulse now = pipeline_.pulse();
    if (now.busy || now != pulse_) changed_ = next_;
    pulse_ = now;
  }

  void hand_out_result() noexcept {
    const ExperimentResult* result = pipeline_.new_result();
    if (result == nullptr) return;
    reload_from_ = next_ + Exchange::kAfterResult;
    if (exchange_.history != nullptr) exchange_.history->results.push(*result);
  }

  void learn() noexcept {
    if (exchange_.history == nullptr) return;
    estimator::LearnedFriction learned;
    while (exchange_.history->learned.pop(learned)) {
      if (tap_ != nullptr) tap_->learned(next_, learned);
      pipeline_.learn(learned);
    }
  }

  void reload() noexcept {
    if (exchange_.reload == nullptr || pulse_.in_experiment || next_ < reload_from_) return;
    Reload* taken = exchange_.reload->take();
    if (taken == nullptr) return;
    if (tap_ != nullptr) tap_->reloaded(next_);
    pipeline_.give_way_to(taken->pipeline, taken->keeps_results);
    port_.select(taken->wanted);
    exchange_.reload->give_back(taken);
  }

  void leave_out_silence() noexcept {
    if (tap_ != nullptr || next_ - changed_ < kAtRest) return;
    const MonoTime until = port_.silent_until();
    if (until < next_ + kBeforeTheEnd) return;
    const std::int64_t samples = (until - kBeforeTheEnd - next_) / period_;
    if (samples <= 0) return;
    next_ += samples * period_;
    pipeline_.on_silence(samples);
    if (sink_ != nullptr) sink_->on_silence(pipeline_.report(), samples);
  }

  void end(estimator::StopReason reason) noexcept {
    outbox_.size = 0;
    const MonoTime now = port_.now();
    if (tap_ != nullptr) tap_->end(now);
    const SampleReport& report = pipeline_.on_end(now, reason, outbox_);
    send();
    if (sink_ != nullptr) sink_->on_report(report);
    hand_out_result();
  }

  void send() noexcept {
    for (std::size_t i = 0; i < outbox_.size; ++i) {
      const SendResult result = port_.send_on(outbox_.bus[i], outbox_.frames[i]);
      if (result == SendResult::kSent) continue;
      ++counters_.sends_failed;
      if (tap_ != nullptr) tap_->failed(due_, outbox_.bus[i], outbox_.frames[i].id.value, result);
      // A link that is down has a fault of its own.
      if (result != SendResult::kDown) {
        pipeline_.on_send_failed(outbox_.frames[i], next_, outbox_.bus[i]);
      }
    }
  }

  Port& port_;
  Pipeline& pipeline_;
  SampleSink* sink_;
  LoopMeters* meters_;
  RecordTap* tap_;
  Exchange exchange_;
  Duration period_;
  MonoTime next_;
  MonoTime due_;                                // of the sample under way, before any were given up
  std::array<BusState, kBusMax> bus_states_{};  // kActive
  std::uint8_t buses_;
  LoopCounters counters_;
  Pulse pulse_;               // of the last sample
  MonoTime changed_ = next_;  // when it became so, or a frame came
  MonoTime reload_from_;
  Outbox outbox_;
  std::array<RxFrame, kBatch> frames_{};
};

}  // namespace

LoopCounters run_loop(Port& port, Pipeline& pipeline, double sample_rate_hz,
                      estimator::StopReason end_reason, SampleSink* sink, LoopMeters* meters,
                      RecordTap* tap, const Exchange& exchange) noexcept {
  return Loop(port, pipeline, sample_rate_hz, sink, meters, tap, exchange).run(end_reason);
}

}  // namespace beltgrip::daemon
