// The signals of a replay for --signals-out: the configuration's roles in SI as the pipeline last
// saw them, and what it made of them. Tools only.
#pragma once

#include <vector>

#include "daemon/core/config/options/config.h"
#include "daemon/core/loop/pipeline.h"
#include "tools/signals/signal_writer.h"

namespace beltgrip::cli {

std::vector<signals::Signal> signal_columns(const daemon::Config& config);

// One value a column; no number where there is none at this sample.
void signal_values(const daemon::SampleReport& report, const daemon::Pipeline& pipeline,
                   const daemon::Config& config, std::vector<double>& values);

}  // namespace beltgrip::cli
