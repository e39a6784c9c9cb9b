// A configuration that takes the place of the running one: made by the helper thread with all its
// memory, taken by the real-time thread between two samples while no experiment runs, and given
// back with what it replaced, for the helper thread to take apart. Two words cross; wait-free.
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "daemon/core/base/port.h"
#include "daemon/core/config/options/config.h"
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

}  // namespace beltgrip::daemon
