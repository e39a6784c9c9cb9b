// What is put between quotation marks at once is what goes there sign by sign, and JSON reads it
// back.
#include "tools/text/json_writer.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

namespace beltgrip::text {
namespace {

std::string in_json(const std::string& text) { return JsonWriter().value(text).take(); }

TEST(JsonWriter, TakesEachSignWhereverItStands) {
  for (int sign = 0; sign < 0x80; ++sign) {
    for (const std::size_t place : {std::size_t{0}, std::size_t{7}, std::size_t{40}}) {
      std::string text(41, 'a');
      text[place] = static_cast<char>(sign);
      const std::string found = in_json(text);
      EXPECT_EQ(nlohmann::json::parse(found).get<std::string>(), text) << sign;
      const bool is_escaped = sign < 0x20 || sign == 0x7F || sign == '"' || sign == '\\';
      EXPECT_EQ(found == '"' + text + '"', !is_escaped) << sign;
    }
  }
}

TEST(JsonWriter, LeavesNothingThatSteersATerminal) {
  EXPECT_EQ(in_json("a\x7F\x1B"), R"("a\u007f\u001b")");
  EXPECT_EQ(in_json("\xC2\x9B"), R"("\u009b")");
  EXPECT_EQ(in_json("\xC2\xB0"
                    "C"),
            "\"\xC2\xB0"
            "C\"");
}

TEST(JsonWriter, ReadsWhatIsNoUtf8AsWindows1252) {
  EXPECT_EQ(in_json("\xB0"
                    "C"),
            "\"\xC2\xB0"
            "C\"");
  EXPECT_EQ(in_json(""), "\"\"");
}

}  // namespace
}  // namespace beltgrip::text
