// A View as one JSON object on one line. Tools only.
#pragma once

#include <string>

#include "tools/monitor/view.h"

namespace beltgrip::monitor {

std::string view_json(const View& view);

}  // namespace beltgrip::monitor
