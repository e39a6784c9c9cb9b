// The daemon's Port over what its flight recorder kept: the frames in the order in which it took
// them, its samples at the instants and as late as it took them, its bus and its troubles to send.
// The same pipeline decides the same on it, byte by byte where the record begins with the daemon.
// The lines: daemon/io/flight_recorder.h. Tools only.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "can_dbc/log/can_log.h"
#include "daemon/core/base/port.h"

namespace beltgrip::ports {

// What the history had told the daemon.
struct RecordedKnowledge {
  struct Group {
    double mu_max = 0.0;  // 0: not known
    double low = 0.0;
    double scatter_percent = 0.0;
  };
  bool doubtful = false, unwritten = false;
  std::array<Group, 4> groups{};
  std::vector<double> memory;  // numbers of estimator/belt/belt_memory.h; none before version 3
};

class RecordPort final : public daemon::Port {
 public:
  using Receiver = std::function<void(daemon::MonoTime, const can::CanFrame&, std::uint8_t bus)>;
  using Learner = std::function<void(const RecordedKnowledge&)>;

  // The newest that is understood; so is every earlier one.
  static constexpr int kVersion = 3;
  // Of a log that is such a record, 0 where it has none that is a number; nothing: it is no record.
  // Throws can::LogOpenError.
  static std::optional<int> version_of(const std::string& path);
  // receiver: of what is sent. learner: told between two samples, as the daemon was, and of what it
  // knew before the first one at once.
  RecordPort(const std::string& path, Receiver receiver, Learner learner);

  bool ends_with_the_daemon() const { return ended_; }
  const can::LogStats& stats() const { return log_->stats(); }
  daemon::Duration duration() const { return now_ - first_; }

  daemon::MonoTime now() noexcept override { return now_; }
  daemon::Wake wait_until(daemon::MonoTime deadline) noexcept override;
  std::size_t receive(std::span<daemon::RxFrame> out) noexcept override;
  daemon::SendResult send(const can::CanFrame& frame) noexcept override {
    return send_on(0, frame);
  }
  daemon::SendResult send_on(std::uint8_t bus, const can::CanFrame& frame) noexcept override;
  daemon::MonoTime silent_until() noexcept override;
  daemon::BusState bus_state() noexcept override { return states_[0]; }
  daemon::BusState bus_state_of(std::uint8_t bus) noexcept override { return states_[bus]; }

 private:
  struct Line {
    daemon::MonoTime t = daemon::MonoTime::origin();
    bool is_frame = false;
    can::CanFrame frame;
    bool sent = false;
    std::uint8_t bus = 0;
    std::string word;                  // of a note
    std::vector<std::string> numbers;  // behind it
  };

  void read();
  static RecordedKnowledge::Group group_of(std::string_view text);
  void obey(const Line& note);

  std::vector<double> memory_;  // the newest that was noted
  std::unique_ptr<can::LogReader> log_;
  Receiver receiver_;
  Learner learner_;
  Line next_;
  bool has_next_ = false;
  bool ended_ = false;
  bool closed_ = false;
  daemon::MonoTime now_, first_, limit_;
  daemon::MonoTime late_;  // when the next sample was taken; 0: in time
  std::uint32_t lost_ = 0;
  std::string further_;  // interface of bus 1; empty: there is none
  std::array<daemon::BusState, daemon::kBusMax> states_{};
  struct Failure {
    unsigned bus;
    std::uint32_t id;
    daemon::SendResult result;
  };
  std::vector<Failure> failed_;  // at the next sample
};

}  // namespace beltgrip::ports
