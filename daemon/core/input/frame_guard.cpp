#include "daemon/core/input/frame_guard.h"

#include <algorithm>
#include <bit>

#include "can_dbc/frame/e2e.h"

namespace beltgrip::daemon {

namespace {

constexpr double kPausePeriods = 2.5;
constexpr Duration kPause = 50 * kMillisecond;

bool has_right_crc(const can::CanFrame& frame, const CrcProtection& crc) noexcept {
  std::array<std::uint8_t, can::kMaxPayload> others{};
  std::size_t count = 0;
  const auto payload = frame.payload();
  for (std::size_t i = 0; i < payload.size(); ++i) {
    if (i != crc.byte) others[count++] = payload[i];
  }
  return can::e2e::crc_profile1(crc.data_id, {others.data(), count}) == payload[crc.byte];
}

}  // namespace

void FrameGuard::count(MonoTime t) noexcept {
  if (!period_) return;
  const MonoTime newest = stamps_[(stamped_ + kFrames - 1) % kFrames];
  const auto pause = std::max(kPause, scaled(*period_, kPausePeriods));
  if (stamped_ > 0 && t - newest > pause) {
    stamped_ = 0;
    wrong_rate_ = false;
  }
  if (stamped_ >= kFrames) {
    // The oldest, which this one replaces: kFrames intervals ago.
    const auto took_ns = static_cast<double>((t - stamps_[stamped_ % kFrames]).ns());
    const auto wanted_ns = static_cast<double>((kFrames * *period_).ns());
    wrong_rate_ = took_ns < kTooFast * wanted_ns || took_ns > kTooSlow * wanted_ns;
  }
  stamps_[stamped_ % kFrames] = t;
  ++stamped_;
}

bool FrameGuard::is_good(const can::CanFrame& frame) noexcept {
  if (protection_->crc && !has_right_crc(frame, *protection_->crc)) return false;
  if (!protection_->counter) return true;
  const auto now = static_cast<std::uint32_t>(protection_->counter->codec.raw(frame.payload()));
  const std::uint32_t numbers = protection_->counter->maximum + 1;
  if (now >= numbers) return false;
  const std::uint32_t step = counter_ ? (now + numbers - *counter_) % numbers : 1;
  counter_ = now;
  if (step > std::min(kCounterStep, numbers / 2)) invalid_ = true;
  return step != 0 && step <= std::min(kCounterStep, numbers / 2);
}

bool FrameGuard::admit(const can::CanFrame& frame) noexcept {
  if (protection_ == nullptr) return true;
  const bool good = is_good(frame);
  bad_ = static_cast<std::uint8_t>(bad_ << 1 | (good ? 0 : 1));
  good_ = good ? good_ + 1 : 0;
  if (std::popcount(bad_) >= kBad) invalid_ = true;
  if (invalid_ && good_ >= kGood) {
    invalid_ = false;
    bad_ = 0;
  }
  return good && !invalid_;
}

}  // namespace beltgrip::daemon
