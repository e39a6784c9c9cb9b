// How many lines with a stamp that lies apart are garbled ones. Of logs and of tables.
#pragma once

#include <cstddef>

namespace beltgrip::can {

// Chosen: stamps in a row from which time then goes on where it was. A garbled line is alone, or
// one of a few; a clock that is set stays so. It decides only about two and more in a row: with 2
// and with 4 the same answers for 60 logs, 12 of them a corpus, most others with one fault each.
inline constexpr std::size_t kStrayStamps = 3;

}  // namespace beltgrip::can
