// Texts of BeltGrip and of others, as they stand in a page.
#include "tools/report/script_text.h"

#include <gtest/gtest.h>

namespace beltgrip::report {
namespace {

TEST(MarkedUp, NamesAndCommandsStandAsCode) {
  EXPECT_EQ(marked_up("see `beltgrip status`; or `a < b`."),
            "see <code>beltgrip status</code>; or <code>a &lt; b</code>.");
}

TEST(MarkedUp, WhatHasNoEndIsText) {
  EXPECT_EQ(marked_up("a ` b & c"), "a ` b &amp; c");
  EXPECT_EQ(marked_up("`a` and `b"), "<code>a</code> and `b");
  EXPECT_EQ(marked_up(""), "");
}

TEST(MarkedUp, NamesOfOthersStayText) {
  EXPECT_EQ(marked_up("`<script>`"), "<code>&lt;script&gt;</code>");
}

}  // namespace
}  // namespace beltgrip::report
