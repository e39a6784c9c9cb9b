#include "daemon/core/experiment/recorded_requests.h"

#include <utility>

namespace beltgrip::daemon {

namespace {
// Chosen: an experiment that begins later lacks the part of the curve that slip is read from.
constexpr Duration kBegins = 100 * kMillisecond;
// Chosen: longer than an experiment without a request takes, from its refusal to its end.
constexpr Duration kNear = kSecond;
}  // namespace

RecordedRequests::RecordedRequests(std::vector<RecordedRequest> requests)
    : requests_(std::move(requests)) {}

void RecordedRequests::step(MonoTime t) noexcept {
  t_ = t;
  while (next_ < requests_.size() && requests_[next_].end.value_or(t + kSecond) <= t) {
    ++next_;
    point_ = 0;
  }
  const RecordedRequest* now = standing();
  while (now != nullptr && point_ < now->course.size() && now->course[point_].t <= t) ++point_;
}

const RecordedRequest* RecordedRequests::standing() const noexcept {
  if (next_ >= requests_.size() || requests_[next_].begin > t_) return nullptr;
  return &requests_[next_];
}

bool RecordedRequests::begins() const noexcept {
  const RecordedRequest* now = standing();
  return now != nullptr && t_ - now->begin <= kBegins;
}

bool RecordedRequests::near() const noexcept {
  return next_ < requests_.size() && requests_[next_].begin <= t_ + kNear;
}

double RecordedRequests::force_N() const noexcept {
  const RecordedRequest* now = standing();
  if (now == nullptr) return 0.0;
  const auto& course = now->course;
  if (point_ == 0) return course.front().force_N;
  const RecordedRequest::Force& before = course[point_ - 1];
  if (point_ == course.size()) return before.force_N;
  const RecordedRequest::Force& after = course[point_];
  const double share = fraction(t_ - before.t, after.t - before.t);
  return before.force_N + share * (after.force_N - before.force_N);
}

}  // namespace beltgrip::daemon
