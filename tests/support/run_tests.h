// What the main of every test program does.
#pragma once

namespace beltgrip::test {

// Runs the tests that GoogleTest's filter lets through. Exit status: 0 all passed; 1 one failed,
// asserted nothing, or there was none to run; kSkipped where the others passed and one was skipped.
int run_tests();

}  // namespace beltgrip::test
