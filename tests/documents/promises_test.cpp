// What a document says to be shown by a test is shown by one that exists: daemon/SECURITY.md and
// tests/PROMISES.md, row by row.
#include <filesystem>
#include <regex>

namespace beltgrip::test {
namespace {

const std::string kSource = BELTGRIP_SOURCE_DIR "/";
const std::string kTests = kSource + "tests/";

std::string read_file(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

std::vector<std::vector<std::string>> rows_of(const std::string& document) {
  std::vector<std::vector<std::string>> out;
  std::istringstream lines(read_file(kSource + document));
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("| ") || line.starts_with("| he can |") ||
        line.starts_with("| promise |")) {
      continue;
    }
    std::vector<std::string> cells;
    for (std::size_t begin = 1; begin < line.size();) {
      const std::size_t end = std::min(line.find(" |", begin), line.size());
      cells.push_back(line.substr(begin, end - begin));
      begin = end + 2;
    }
    out.push_back(cells);
  }
  return out;
}

std::vector<std::smatch> matches(const std::string& text, const char* pattern) {
  const std::regex expression(pattern);
  return {std::sregex_iterator(text.begin(), text.end(), expression), std::sregex_iterator()};
}

// All that says how the tests are built.
std::string build_files() {
  std::string out;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(kTests)) {
    if (entry.path().filename() == "CMakeLists.txt") out += read_file(entry.path().string());
  }
  return out;
}

// The file of a test program, by its name without a folder; empty where there is none.
std::string source_of(const std::string& program) {
  for (const auto& entry : std::filesystem::recursive_directory_iterator(kTests)) {
    const std::filesystem::path& path = entry.path();
    if (path.filename() == program + ".cpp" || path.filename() == program) return path.string();
  }
  return {};
}

TEST(Security, EachTestThatIsNamedExistsWithItsCases) {
  int named = 0;
  for (const std::vector<std::string>& row : rows_of("daemon/SECURITY.md")) {
    ASSERT_EQ(row.size(), 4U) << row.at(0);
    for (const std::smatch& test : matches(row[2], "`([^`]+)`(?: \\(([A-Z][A-Za-z0-9, ]+)\\))?")) {
      ++named;
      const std::string path = kTests + test[1].str();
      const bool source = std::filesystem::exists(path + ".cpp");
      EXPECT_TRUE(source || std::filesystem::exists(path)) << test[1] << ": " << row[0];
      const std::string cases = test[2];
      for (const std::smatch& each : matches(cases, "[A-Za-z0-9]+")) {
        EXPECT_NE(read_file(path + ".cpp").find(each.str()), std::string::npos)
            << test[1] << " has no " << each.str();
      }
    }
  }
  EXPECT_GT(named, 20);
}

TEST(Promises, EachHasATestThatExists) {
  const std::string built = build_files();
  int promises = 0;
  for (const std::vector<std::string>& row : rows_of("tests/PROMISES.md")) {
    ASSERT_EQ(row.size(), 5U) << row.at(0);
    ++promises;
    EXPECT_EQ(row[3].find("NOT KEPT"), std::string::npos) << row[0];
    int found = 0;
    for (const std::smatch& each : matches(row[1], "(build/tests/|tests/)([A-Za-z0-9_/.]+)")) {
      ++found;
      const bool program = each[1].str() == "build/tests/";
      const std::string name = each[2];
      const bool exists =
          program ? built.find(name) != std::string::npos : std::filesystem::exists(kTests + name);
      EXPECT_TRUE(exists) << each.str() << " does not exist: " << row[0];
    }
    for (const std::smatch& each :
         matches(row[1], "build/tests/([a-z0-9_]+)[^`]*--gtest_filter='?([A-Za-z0-9*_.]+)")) {
      const std::string source = read_file(source_of(each[1]));
      const std::string filter = each[2];
      for (const std::smatch& word : matches(filter, "[A-Za-z0-9_]+")) {
        EXPECT_NE(source.find(word.str()), std::string::npos) << filter << ": no " << word.str();
      }
    }
    EXPECT_TRUE(found > 0 || row[1].find("cmake") != std::string::npos ||
                row[1].find("ctest") != std::string::npos)
        << "a promise without a test: " << row[0];
  }
  EXPECT_GT(promises, 40);
}

}  // namespace
}  // namespace beltgrip::test
