// What the text of the tree must not contain: includes across the layers, calls that do not belong
// to a layer, a second place that sends, allocation on the real-time path, traces of a workplace.
// Text only: comments and string literals are blanked before code is judged.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace beltgrip::test {

struct SourceFile {
  std::string path;  // relative to the root of the repository, with slashes
  std::string text;
};

// All files of the repository but build folders and .git.
std::vector<SourceFile> read_tree(const std::string& root);
// One line for each violation: "path:line: what (why)".
std::vector<std::string> check_tree(const std::vector<SourceFile>& files);

// Documents (.md, .txt) that a text names in backticks, each once.
std::vector<std::string> documents_named_in(const std::string& text);

// C++ text with comments and the insides of string and character literals replaced by spaces;
// line breaks stay. Include lines keep their file name.
std::string blank_comments_and_strings(std::string_view text);

}  // namespace beltgrip::test
