// One trial of the blind test: draw, seal, answer, open.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>

#include "tests/statistics/blind/generator.h"

namespace beltgrip::blind {

enum class Kind { kNothing, kSingle, kPair, kUnknown, kStress };

struct Envelope {
  Kind kind = Kind::kNothing;
  Trial trial;
};
Envelope draw_envelope(std::uint64_t number);

// The ledger's line: truth, answer, oracle, rivals, processor time.
nlohmann::json run_trial(std::uint64_t number);

}  // namespace beltgrip::blind
