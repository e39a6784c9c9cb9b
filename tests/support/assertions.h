// GoogleTest that counts what a test asserts: main.cpp fails a test that asserted nothing.
#pragma once

#include <gtest/gtest.h>

#include <atomic>

namespace beltgrip::test {

// Assertions that began in this process, also from threads; a number of the test program's own.
inline std::atomic<long> assertions_begun{0};

}  // namespace beltgrip::test

// Every assertion of GoogleTest begins with this macro, whether it holds or not. A version without
// it would count nothing, and every test would fail.
#undef GTEST_AMBIGUOUS_ELSE_BLOCKER_
#define GTEST_AMBIGUOUS_ELSE_BLOCKER_                               \
  switch (static_cast<void>(++beltgrip::test::assertions_begun), 0) \
  case 0:                                                           \
  default:
