// The main of a program of its own.
#include "tests/support/assertions.h"
#include "tests/support/run_tests.h"

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  return beltgrip::test::run_tests();
}
