// A configuration that takes the place of the running one: made by the helper thread with all its
// memory, taken by the real-time thread between two samples while no experiment runs, and given
// back with what it replaced, for the helper thread to take apart. Two words cross; wait-free.
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "daemon/core/base/port.h"
#include "daemon/core/config/config.h"
#include "daemon/core/loop/loop.h"
#include "daemon/core/loop/pipeline.h"

namespace beltgrip::daemon {

struct Reload {
  Config config;
  std::vector<WantedFrames> wanted;
  bool keeps_results = false;  // results so far were measured with the same variator and inputs
  Pipeline pipeline;           // of `config`; of the former one when it comes back
};

class ReloadSlot {
 public:
  ReloadSlot() = default;
  ~ReloadSlot();
  ReloadSlot(const ReloadSlot&) = delete;
  ReloadSlot& operator=(const ReloadSlot&) = delete;

  // Helper thread. What had been offered before and was not taken comes back.
  std::unique_ptr<Reload> offer(std::unique_ptr<Reload> reload) noexcept {
    return std::unique_ptr<Reload>(offered_.exchange(reload.release(), std::memory_order_acq_rel));
  }
  // Helper thread: one that is in force now; nullptr when there is none.
  std::unique_ptr<Reload> collect() noexcept {
    return std::unique_ptr<Reload>(taken_.exchange(nullptr, std::memory_order_acq_rel));
  }

  // Real-time thread. nullptr while the one taken before has not been collected.
  Reload* take() noexcept {
    if (offered_.load(std::memory_order_relaxed) == nullptr) return nullptr;
    if (taken_.load(std::memory_order_acquire) != nullptr) return nullptr;
    return offered_.exchange(nullptr, std::memory_order_acq_rel);
  }
  void give_back(Reload* reload) noexcept { taken_.store(reload, std::memory_order_release); }

 private:
  std::atomic<Reload*> offered_{nullptr};
  std::atomic<Reload*> taken_{nullptr};
};

// After each sample: puts what is offered in force, unless an experiment runs or its result may
// still be on its way to the history.
class ReloadLink final : public SampleSink {
 public:
  static constexpr Duration kAfterResult = kSecond;

  // next: where the reports go on to. It is done with a report before its pipeline goes. tap: of
  // the flight recorder, where there is one.
  ReloadLink(ReloadSlot& slot, Pipeline& pipeline, Port& port, SampleSink& next,
             RecordTap* tap = nullptr) noexcept
      : slot_(slot), pipeline_(pipeline), port_(port), next_(next), tap_(tap) {}
  void on_report(const SampleReport& report) noexcept override;

 private:
  ReloadSlot& slot_;
  Pipeline& pipeline_;
  Port& port_;
  SampleSink& next_;
  RecordTap* tap_;
  MonoTime not_before_ = 0;
};

}  // namespace beltgrip::daemon
