// How many lines with a stamp that lies apart are garbled ones. Of logs and of tables.
#pragma once

#include <cstddef>

namespace beltgrip::can {

// Chosen: stamps in a row from which time then goes on where it was. A garbled line is alone, or
// one of a few; a clock that is set stays so. It decides only about two and more in a row.
inline constexpr std::size_t kStrayStamps = 3;

}  // namespace beltgrip::can
