// Any stream of frames with any stamps into the pipeline, judged by what leaves it: identifier,
// length, counter, CRC, codes; the stop flag that stays up; a lower bound that is never a value;
// reports that are finite.
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>

#include "daemon/core/config/load/load_config.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/loop/pipeline.h"

namespace {

using namespace beltgrip;
using namespace beltgrip::daemon;

constexpr char kDbc[] =
    "VERSION \"\"\nBS_:\nBU_: A\n"
    "BO_ 256 Speeds: 8 A\n SG_ Primary : 0|16@1+ (0.125,0) [0|8000] \"rpm\" A\n"
    " SG_ Secondary : 16|32@1- (1,0) [0|0] \"rad/s\" A\n"
    "BO_ 257 Rest: 8 A\n SG_ Pressure : 7|16@0+ (0.001,0) [0|60] \"bar\" A\n"
    " SG_ Torque : 16|16@1- (0.1,0) [-500|500] \"Nm\" A\n SG_ Flag : 32|2@1+ (1,0) [0|3] \"\" A\n"
    "SIG_VALTYPE_ 256 Secondary : 1;\n";
constexpr char kToml[] =
    "[bus]\ndbc = [\"a.dbc\"]\n[signals]\nprimary_speed = \"Speeds.Primary\"\n"
    "secondary_speed = \"Speeds.Secondary\"\nsecondary_pressure = \"Rest.Pressure\"\n"
    "engine_torque = \"Rest.Torque\"\nexperiment_active = \"Rest.Flag\"\n[experiment]\ntrigger = ";

void require(bool condition, int line = __builtin_LINE()) {
  if (condition) return;
  std::fprintf(stderr, "fuzz_frames.cpp:%d\n", line);
  std::abort();
}

Config make_config(const std::string& trigger) {
  std::string directory = (std::filesystem::temp_directory_path() / "fuzz_frames.XXXXXX").string();
  require(mkdtemp(directory.data()) != nullptr);
  const auto write_file = [&](const char* name, const std::string& text) {
    std::FILE* file = std::fopen((directory + name).c_str(), "wb");
    require(file != nullptr && std::fwrite(text.data(), 1, text.size(), file) == text.size());
    std::fclose(file);
  };
  write_file("/a.dbc", kDbc);
  write_file("/c.toml", std::string(kToml) + "\"" + trigger + "\"\n");
  ConfigResult result = load_config(directory + "/c.toml");
  std::filesystem::remove_all(directory);
  require(result.config.has_value());
  return *result.config;
}

std::uint8_t crc8(std::uint16_t id, const std::uint8_t* bytes_1_to_7) {
  std::array<std::uint8_t, 9> all{static_cast<std::uint8_t>(id),
                                  static_cast<std::uint8_t>(id >> 8)};
  std::memcpy(all.data() + 2, bytes_1_to_7, 7);
  unsigned crc = 0;
  for (const std::uint8_t byte : all) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit)
      crc = (crc & 0x80U) != 0 ? (crc << 1 ^ 0x1DU) & 0xFFU : crc << 1;
  }
  return static_cast<std::uint8_t>(crc);
}

class Judge {
 public:
  void frames(const Outbox& outbox) {
    for (std::size_t i = 0; i < outbox.size; ++i) frame(outbox.frames[i]);
  }
  void report(const SampleReport& report) {
    require(!stop_ || report.macro_slip_stop || !report.in_experiment);
    stop_ = report.macro_slip_stop && report.in_experiment;
    require(!report.macro_slip_stop || report.in_experiment || report.state == State::kInhibited);
    if (report.sample.usable) {
      require(std::isfinite(report.sample.omega_p_rad_s) && report.sample.omega_p_rad_s > 0.0);
      require(std::isfinite(report.sample.omega_s_rad_s) && std::isfinite(report.sample.torque_Nm));
      require(std::isfinite(report.sample.secondary_pressure_Pa));
      require(report.sample.t_ns > last_sample_.ns());
      last_sample_ = MonoTime::of_ns(report.sample.t_ns);
    }
    if (report.curve.usable) {
      require(std::isfinite(report.curve.mu_star) && std::isfinite(report.curve.friction_slope));
      require(std::isfinite(report.curve.sigma_star_percent));
    }
    if (!report.new_result) return;
    const auto& peak = report.result.peak;
    require(report.result.outcome != Outcome::kNone);
    require((report.result.outcome == Outcome::kCompleted) ==
            (peak.kind == estimator::PeakKind::kValue));
    if (peak.kind == estimator::PeakKind::kValue) {
      require(std::isfinite(peak.mu_max) && peak.mu_max_std > 0.0 &&
              std::isfinite(peak.mu_max_std));
    }
  }

 private:
  void frame(const can::CanFrame& frame) {
    require(!frame.id.extended && !frame.remote && !frame.fd && !frame.error && frame.length == 8);
    require(frame.id.value == 0x6A0 || frame.id.value == 0x6A1 || frame.id.value == 0x6A3);
    require(crc8(static_cast<std::uint16_t>(frame.id.value), frame.data.data() + 1) ==
            frame.data[0]);
    const unsigned counter = frame.data[1] & 15U;
    int& last = counters_[frame.id.value - 0x6A0];
    require(last < 0 ? counter == 0 : counter == (static_cast<unsigned>(last) + 1) % 15);
    last = static_cast<int>(counter);
    if (frame.id.value == 0x6A0) {
      const unsigned kind = frame.data[1] >> 4 & 3U;
      const bool valid = (frame.data[1] & 0x40U) != 0;
      require(kind <= 2 && valid == (kind == 1));
    }
  }

  std::array<int, 4> counters_{-1, -1, -1, -1};
  bool stop_ = false;
  MonoTime last_sample_ = MonoTime::min();
};

// Takes bytes off the front; zeros at the end.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  bool empty() const { return size_ == 0; }
  std::uint8_t byte() {
    if (size_ == 0) return 0;
    --size_;
    return *data_++;
  }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Config always = make_config("always");
  static const Config by_signal = make_config("signal");
  constexpr std::array<std::uint32_t, 8> kIds{0x100, 0x101, 0x100, 0x101,
                                              0x6A0, 0x6A3, 0x7FF, 0x40};
  constexpr Duration kPeriod = 5 * kMillisecond;
  constexpr MonoTime kEnd{60 * kSecond};

  Input input(data, size);
  Pipeline pipeline((input.byte() & 1U) != 0 ? always : by_signal);
  Judge judge;
  MonoTime now{}, next{};
  while (!input.empty() && now < kEnd) {
    const std::uint8_t step = input.byte();
    now += step == 255 ? 2 * kSecond : step * kMillisecond / 4;
    for (; next <= now; next += kPeriod) {
      Outbox outbox;
      judge.report(pipeline.on_sample(next, outbox));
      judge.frames(outbox);
    }
    const std::uint8_t what = input.byte();
    if (what == 255) {
      pipeline.on_bus_state(static_cast<BusState>(input.byte() % 6), now);
      continue;
    }
    if (what == 254) {
      pipeline.on_late(now, (input.byte() & 1U) != 0);
      continue;
    }
    RxFrame frame;
    frame.t = (what & 0x80U) != 0 ? now - input.byte() * kSecond : now;
    frame.frame.id = {kIds[what & 7U], (what & 0x08U) != 0 && (what & 0x10U) != 0};
    frame.frame.error = (what & 7U) == 7;
    frame.frame.remote = (what & 0x60U) == 0x60;
    frame.frame.fd = (what & 0x30U) == 0x30;
    frame.frame.length = (what & 0x40U) != 0 ? input.byte() % 65 : 8;
    for (std::size_t i = 0; i < 8 && i < frame.frame.length; ++i)
      frame.frame.data[i] = input.byte();
    pipeline.on_frame(frame);
  }
  Outbox outbox;
  judge.report(pipeline.on_end(now, estimator::StopReason::kTraceEnd, outbox));
  judge.frames(outbox);
  return 0;
}
