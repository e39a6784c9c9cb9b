// Independent pieces of work on several threads. Which thread does which piece changes nothing in
// the result: each writes its own place only.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <thread>
#include <vector>

namespace beltgrip::diagnose {

template <typename Work>
void in_parallel(int jobs, std::size_t count, const Work& work) {
  std::atomic<std::size_t> next{0};
  const auto run = [&] {
    for (std::size_t i = next++; i < count; i = next++) work(i);
  };
  std::vector<std::jthread> others;
  for (std::size_t i = 1; i < std::min(static_cast<std::size_t>(jobs), count); ++i) {
    others.emplace_back(run);
  }
  run();
}

}  // namespace beltgrip::diagnose
