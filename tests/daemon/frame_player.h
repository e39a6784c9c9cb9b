// A Port over a vector of frames in log time, and a sink that keeps every report.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "daemon/core/base/port.h"
#include "daemon/core/loop/loop.h"

namespace beltgrip::test {

struct SentFrame {
  daemon::MonoTime t{};
  can::CanFrame frame;
  std::uint8_t bus = 0;
  friend bool operator==(const SentFrame&, const SentFrame&) = default;
};

class FramePlayer final : public daemon::Port {
 public:
  explicit FramePlayer(std::vector<can::StampedFrame> frames) : frames_(std::move(frames)) {
    if (!frames_.empty()) now_ = daemon::MonoTime::of_ns(frames_.front().t_ns);
  }

  daemon::MonoTime now() noexcept override { return now_; }
  daemon::Wake wait_until(daemon::MonoTime deadline) noexcept override {
    if (next_ == frames_.size()) return daemon::Wake::kClosed;
    if (frames_[next_].t_ns <= deadline.ns()) {
      limit_ = deadline;
      return daemon::Wake::kFrames;
    }
    now_ = std::max(now_, deadline);
    return daemon::Wake::kDeadline;
  }
  std::size_t receive(std::span<daemon::RxFrame> out) noexcept override {
    std::size_t count = 0;
    while (count < out.size() && next_ < frames_.size() && frames_[next_].t_ns <= limit_.ns()) {
      out[count] = {};
      out[count].t = daemon::MonoTime::of_ns(frames_[next_].t_ns);
      out[count].frame = frames_[next_].frame;
      out[count].bus = frames_[next_].bus;
      now_ = std::max(now_, out[count].t);
      ++count;
      ++next_;
    }
    return count;
  }
  daemon::SendResult send(const can::CanFrame& frame) noexcept override {
    return send_on(0, frame);
  }
  daemon::SendResult send_on(std::uint8_t to, const can::CanFrame& frame) noexcept override {
    sent.push_back({now_, frame, to});
    return daemon::SendResult::kSent;
  }
  daemon::BusState bus_state() noexcept override { return bus; }
  daemon::BusState bus_state_of(std::uint8_t) noexcept override { return bus; }

  std::vector<SentFrame> sent;
  daemon::BusState bus = daemon::BusState::kActive;

 private:
  std::vector<can::StampedFrame> frames_;
  std::size_t next_ = 0;
  daemon::MonoTime now_{};
  daemon::MonoTime limit_{};
};

class ReportKeeper final : public daemon::SampleSink {
 public:
  void on_report(const daemon::SampleReport& report) noexcept override {
    reports.push_back(report);
    if (report.new_result) results.push_back(report.result);
  }
  std::vector<daemon::SampleReport> reports;
  std::vector<daemon::ExperimentResult> results;
};

}  // namespace beltgrip::test
