#include "tests/system/vcan/other_vehicle/virtual_drive.h"

#include <algorithm>
#include <stdexcept>

#include "daemon/core/config/load/load_config.h"
#include "tests/daemon/test_vehicle.h"

namespace beltgrip::other {
namespace {

constexpr daemon::MonoTime kStart{daemon::kSecond};
// Chosen: no sample at the instant of a frame.
constexpr daemon::Duration kPhase = daemon::Duration::of_ns(700'000);  // ns

daemon::Config configuration(const std::string& trigger, const std::string& settings) {
  test::TemporaryDirectory folder;
  folder.write("other.dbc", dbc_text());
  daemon::ConfigResult result =
      daemon::load_config(folder.write("other.toml", configuration_text(trigger) + settings));
  if (!result.errors.empty()) throw std::invalid_argument(result.errors.front().text);
  return std::move(result.config).value();
}

}  // namespace

VirtualDrive::VirtualDrive(const Kind& kind, std::size_t seed, const std::string& settings)
    : Ride(kind, seed),
      pipeline_(std::make_unique<daemon::Pipeline>(
          configuration(kind.torque_Nm < 0.0 ? "coast_down" : "steady", settings))),
      next_sample_(kStart + kPhase) {
  pipeline_->on_bus_state(daemon::BusState::kActive, kStart);
}

void VirtualDrive::put(canid_t id, const Bytes& frame) {
  daemon::RxFrame received;
  received.t = kStart + ticks() * daemon::Duration::of_s(kTick_s);
  received.frame.id = {id & CAN_EFF_MASK, (id & CAN_EFF_FLAG) != 0};
  received.frame.length = static_cast<std::uint8_t>(frame.size());
  std::ranges::copy(frame, received.frame.data.begin());
  pipeline_->on_frame(received);
}

void VirtualDrive::exchange() {
  const daemon::MonoTime now = kStart + ticks() * daemon::Duration::of_s(kTick_s);
  for (; next_sample_ < now; next_sample_ += 5 * daemon::kMillisecond) sample(next_sample_);
  for (const can::CanFrame& each : under_way_) {
    hear(each.id.value, Bytes(each.data.begin(), each.data.begin() + each.length));
  }
  under_way_.clear();
}

void VirtualDrive::sample(daemon::MonoTime t) {
  daemon::Outbox out;
  const daemon::SampleReport& report = pipeline_->on_sample(t, out);
  if (report.new_result) experiments_.push_back(report.result);
  for (std::size_t i = 0; i < out.size; ++i) {
    daemon::RxFrame echo;
    echo.t = t;
    echo.frame = out.frames[i];
    echo.own_echo = true;
    pipeline_->on_frame(echo);
    under_way_.push_back(out.frames[i]);
  }
}

}  // namespace beltgrip::other
