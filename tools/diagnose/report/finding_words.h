// A finding in the words of somebody who does not know its name.
#pragma once

#include <string>
#include <string_view>

#include "tools/diagnose/data/diagnosis.h"

namespace beltgrip::diagnose {

// With so many digits, and without an exponent where that is only large: "360" of 3.6e+02.
std::string readable(double value, int digits);
// What one parameter of one effect is, with an article, of a size of that sign; empty: the table
// has none.
std::string words_of(std::string_view effect, std::string_view parameter, double size);
// What a test of what is left looks for, by its name in JSON; empty: the table has none.
std::string_view words_of_test(std::string_view test);
// In what a person is told a signal, an error of it, or what a function acts on: unit, and times
// the SI value. what: its name in JSON.
struct Display {
  std::string_view unit;
  double per_SI = 1.0;
};
Display display_of(std::string_view what);
// A value of a signal so told. "0.33 Nm", "1.2 bar", "0.7 %"
std::string told(std::string_view what, double value, int digits = 2);
// "1.3 -> 0.5 [0.2, 1.5] Nm"
std::string told_change(std::string_view what, double before, double after, double low,
                        double high);
std::string_view unit_of(std::string_view effect, std::string_view parameter);  // empty: none
// "a drag that grows with the clamp force, 0.50 ± 0.01 Nm/kN (torque_loss)"
std::string in_words(const Finding& finding);

}  // namespace beltgrip::diagnose
