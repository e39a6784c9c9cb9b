#include "tools/diagnose/infer/parallel.h"

#include <gtest/gtest.h>

#include <mutex>
#include <set>
#include <stdexcept>
#include <string>

namespace beltgrip::diagnose {
namespace {

TEST(Parallel, EveryPieceIsDoneOnceWhateverTheThreads) {
  for (const int jobs : {1, 2, 5, 50}) {
    std::vector<int> done(20, 0);
    in_parallel(jobs, done.size(), [&](std::size_t i) { ++done[i]; });
    EXPECT_EQ(done, std::vector<int>(20, 1)) << jobs;
  }
}

TEST(Parallel, WithinAPieceNoFurtherThreadsAreBegun) {
  std::mutex mutex;
  std::set<std::thread::id> threads;
  in_parallel(2, 4, [&](std::size_t) {
    in_parallel(8, 8, [&](std::size_t) {
      const std::scoped_lock lock(mutex);
      threads.insert(std::this_thread::get_id());
    });
  });
  EXPECT_LE(threads.size(), 2U);
  EXPECT_FALSE(is_a_piece);
}

TEST(Parallel, TheFirstPiecesExceptionGetsOut) {
  for (const int jobs : {1, 3}) {
    try {
      in_parallel(jobs, 9, [](std::size_t i) {
        if (i > 3) throw std::runtime_error(std::to_string(i));
      });
      FAIL() << jobs;
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "4") << jobs;
    }
  }
}

}  // namespace
}  // namespace beltgrip::diagnose
