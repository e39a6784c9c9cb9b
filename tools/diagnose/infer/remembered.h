// Answers to questions that are asked again: the same answer, without the work. A copy remembers
// with the one that it is of.
#pragma once

#include <algorithm>
#include <cstddef>
#include <deque>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace beltgrip::diagnose {

template <typename Answer>
class Remembered {
 public:
  explicit Remembered(std::size_t most) : most_(most) {}

  // question: all numbers that the answer depends on. will_do: of a known answer; if not, anew.
  template <typename Find, typename WillDo>
  Answer of(const std::vector<double>& question, const Find& find, const WillDo& will_do) const {
    {
      const std::scoped_lock lock(kept_->mutex);
      const auto found = std::find_if(kept_->all.begin(), kept_->all.end(), [&](const auto& each) {
        return each.first == question && will_do(each.second);
      });
      if (found != kept_->all.end()) return found->second;
    }
    Answer answer = find();
    const std::scoped_lock lock(kept_->mutex);
    kept_->all.emplace_back(question, answer);
    if (kept_->all.size() > most_) kept_->all.pop_front();
    return answer;
  }
  template <typename Find>
  Answer of(const std::vector<double>& question, const Find& find) const {
    return of(question, find, [](const Answer&) { return true; });
  }

 private:
  struct Kept {
    std::mutex mutex;
    std::deque<std::pair<std::vector<double>, Answer>> all;
  };
  std::size_t most_;
  std::shared_ptr<Kept> kept_ = std::make_shared<Kept>();
};

}  // namespace beltgrip::diagnose
