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

// The same of what was learned, in the order of `learned`: points that the data ask for, and those
// that are left with all of it in the model, over the variable; both in the unit of the file.
std::vector<std::vector<report::Series>> points_of_learned(
    const Campaign& campaign, const ModelState& extended,
    const std::vector<LearnedFinding>& learned);

}  // namespace beltgrip::diagnose
