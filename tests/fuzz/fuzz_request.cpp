// A request in the closed loop: the bytes are the numbers from which a case of the fault campaign
// is drawn - belt, vehicle, sensors, faults and their instants - and the campaign's own verdict
// judges: no gross slip beyond that of the drive without the daemon (G1), the end of a request on
// time (G4), every invariant of the frames. The libFuzzer is told how far the belt slipped, so that
// it keeps what came nearer to a broken promise. A case that breaks one is printed as a file for
// regressions/.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "tests/statistics/campaign/campaign_case.h"
#include "tests/statistics/campaign/campaign_run.h"

#ifdef __clang__
// Counters beside those of the code's branches: a value not seen before makes an input worth
// keeping.
__attribute__((section("__libfuzzer_extra_counters")))
#endif
static std::uint8_t slip_reached[64];

namespace {

using namespace beltgrip::test;

constexpr double kSlipStep_percent = 0.5;  // between two counters
constexpr double kEnergyStep_J = 5.0;

// Two bytes are a number; without any left they go on in a sequence that depends on their count
// alone, so that a short input still is a whole case.
class Numbers {
 public:
  Numbers(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  double next() {
    if (size_ < 2) return static_cast<double>(++beyond_ * 40503U % 65536U) / 65536.0;
    const unsigned word = data_[0] | static_cast<unsigned>(data_[1]) << 8U;
    data_ += 2;
    size_ -= 2;
    return word / 65536.0;
  }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
  unsigned beyond_ = 0;
};

void reached(std::size_t first, double value, double step) {
  const auto place = static_cast<std::size_t>(std::clamp(value / step, 0.0, 31.0));
  slip_reached[first + place] = 1;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Numbers numbers(data, size);
  const double surprise = numbers.next();
  const CampaignCase drawn = draw_case(
      1, [&] { return numbers.next(); }, [&] { return surprise; });
  const CampaignVerdict verdict = run_case(drawn);
  if (verdict.guaranteed) {
    reached(0, verdict.slip_max_percent, kSlipStep_percent);
    reached(32, verdict.energy_J, kEnergyStep_J);
  }
  if (verdict.violations.empty()) return 0;
  std::fprintf(stderr, "# base %s seed 1\n%s\n", drawn.base.c_str(), drawn.toml.c_str());
  for (const std::string& each : verdict.violations) std::fprintf(stderr, "%s\n", each.c_str());
  std::abort();
}
