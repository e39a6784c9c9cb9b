// The completion, asked as bash asks it.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

// What may follow these words; the last one is begun.
std::string completed(const std::vector<std::string>& words) {
  const std::string program = program_path();
  std::string script = "PATH='" + program.substr(0, program.rfind('/')) +
                       "':$PATH; source '" BELTGRIP_SOURCE_DIR
                       "/tools/package/beltgrip.bash'; COMP_WORDS=(";
  for (const std::string& word : words) script += "'" + word + "' ";
  script += "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _beltgrip; echo \"${COMPREPLY[*]}\"";
  const RunResult result = run({"/bin/bash", "-c", script}, Milliseconds(30'000));
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(result.err, "");
  return result.out;
}

TEST(Completion, KnowsWhatHelpKnows) {
  EXPECT_EQ(completed({"beltgrip", "re"}), "replay report\n");
  EXPECT_EQ(completed({"beltgrip", "dbc", ""}), "show decode encode check\n");
  EXPECT_EQ(completed({"beltgrip", "replay", "--j"}), "--join --jobs --json\n");
  EXPECT_EQ(completed({"beltgrip", "replay", "a.log", "--j"}), "--join --jobs --json\n");
  EXPECT_EQ(completed({"beltgrip", "dbc", "decode", "--mes"}), "--messages\n");
  EXPECT_EQ(completed({"beltgripd", "--rec"}), "--record\n");
  EXPECT_EQ(completed({"beltgrip", "hel"}), "help\n");
  EXPECT_EQ(completed({"beltgrip", "help", "mon"}), "monitor\n");
}

TEST(Completion, KnowsTheValues) {
  EXPECT_EQ(completed({"beltgrip", "replay", "--method", ""}), "robust paper\n");
  EXPECT_EQ(completed({"beltgrip", "simulate", "--scenario", "worn"}), "worn-belt\n");
  EXPECT_EQ(completed({"beltgripd", "--log-level", "w"}), "warning\n");
  EXPECT_EQ(completed({"beltgrip", "simulate", "--belt", ""}), "new worn\n");
  // Of interfaces those that there are: no pattern, and nothing but names.
  EXPECT_EQ(completed({"beltgrip", "replay", "--interface", ""}).find('*'), std::string::npos);
  EXPECT_EQ(completed({"beltgrip", "status", ""}).find('*'), std::string::npos);
  EXPECT_EQ(completed({"beltgrip", "replay", "--config", ""}), "\n") << "a file: by the shell";
}

}  // namespace
}  // namespace beltgrip::test
