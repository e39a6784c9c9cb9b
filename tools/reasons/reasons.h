// What each inhibit and each fault means, and what to do about it: the words of tools/NO_RESULT.md,
// which is generated from them, and of every command that tells a reason. Those of the stop reasons
// stand with their causes (daemon/core/input/stop_cause.h). Tools only.
#pragma once

#include <string_view>

#include "daemon/core/base/faults.h"
#include "daemon/core/experiment/arming.h"

namespace beltgrip::reasons {

struct Words {
  std::string_view means, remedy;
};

const Words& words_of(daemon::Inhibit inhibit);
const Words& words_of(daemon::Fault fault);

}  // namespace beltgrip::reasons
