// Independent pieces of work on several threads. Which thread does which piece changes nothing in
// the result: each writes its own place only.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <thread>
#include <vector>

namespace beltgrip::diagnose {

// Within a piece no further threads are begun: there are as many at work as were asked for.
inline thread_local bool is_a_piece = false;

// Of exceptions the one of the first piece gets out, as if all had been done in turn.
template <typename Work>
void in_parallel(int jobs, std::size_t count, const Work& work) {
  const std::size_t threads = is_a_piece ? 1 : std::min(static_cast<std::size_t>(jobs), count);
  if (threads <= 1) {
    for (std::size_t i = 0; i < count; ++i) work(i);
    return;
  }
  std::atomic<std::size_t> next{0};
  std::vector<std::exception_ptr> failed(count);
  const auto run = [&] {
    is_a_piece = true;
    for (std::size_t i = next++; i < count; i = next++) {
      try {
        work(i);
      } catch (...) {
        failed[i] = std::current_exception();
      }
    }
    is_a_piece = false;
  };
  {
    std::vector<std::jthread> others;
    for (std::size_t i = 1; i < threads; ++i) others.emplace_back(run);
    run();
  }
  const auto first = std::find_if(failed.begin(), failed.end(),
                                  [](const std::exception_ptr& each) { return each != nullptr; });
  if (first != failed.end()) std::rethrow_exception(*first);
}

}  // namespace beltgrip::diagnose
