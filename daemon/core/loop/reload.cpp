#include "daemon/core/loop/reload.h"

namespace beltgrip::daemon {

ReloadSlot::~ReloadSlot() {
  offer(nullptr);
  collect();
}

}  // namespace beltgrip::daemon
