// The picture of a finding: what the data ask for at the point where it acts, over what it follows,
// without it, as fitted, and what is left with it.
#pragma once

#include <vector>

#include "tools/diagnose/data/diagnosis.h"
#include "tools/diagnose/infer/engine.h"
#include "tools/report/html_page.h"

namespace beltgrip::diagnose {

// One a size found, in the order of the slots. extended: the state with the findings.
std::vector<report::Chart> pictures_of(const Campaign& campaign, const ModelState& extended,
                                       const std::vector<Finding>& findings);

}  // namespace beltgrip::diagnose
