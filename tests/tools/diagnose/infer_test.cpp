// What separates a cause from noise that happens to fit.
#include "tools/diagnose/infer/infer.h"

#include <gtest/gtest.h>

namespace beltgrip::diagnose {
namespace {

TEST(Scatter, ACauseDoesNotDriveTheExperimentsApart) {
  const Scatter usual = default_scatter();
  Scatter apart = usual;
  apart.variance[0] *= 9.0;
  EXPECT_TRUE(parts_experiments(usual, apart));
  // On balance: what makes them alike elsewhere by as much parts nothing.
  apart.variance[2] /= 9.0;
  EXPECT_FALSE(parts_experiments(usual, apart));
  EXPECT_FALSE(parts_experiments(apart, usual));
  EXPECT_FALSE(parts_experiments(usual, usual));
}

TEST(Scatter, WhatHealthyExperimentsDifferByIsNotDrivenApart) {
  Scatter alike = default_scatter();
  alike.variance[3] /= 9.0;
  EXPECT_FALSE(parts_experiments(alike, default_scatter()));
  Scatter apart = default_scatter();
  apart.variance[3] *= 9.0;
  EXPECT_TRUE(parts_experiments(alike, apart));
}

}  // namespace
}  // namespace beltgrip::diagnose
