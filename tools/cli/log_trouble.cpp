#include "tools/cli/log_trouble.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <vector>

namespace beltgrip::cli {

namespace {

constexpr int kLinesLooked = 60;
constexpr std::size_t kColumnsLeast = 3;
constexpr std::size_t kNameLongest =
    64;  // chosen: a signal's long name and its unit; prose is longer

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r\"";
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

std::vector<std::string> cells_of(std::string_view line, char separator) {
  std::vector<std::string> cells;
  for (std::size_t at = 0; at <= line.size();) {
    const std::size_t end = std::min(line.find(separator, at), line.size());
    cells.emplace_back(trimmed(line.substr(at, end - at)));
    at = end + 1;
  }
  return cells;
}

// Names, no numbers.
bool is_head(const std::vector<std::string>& cells) {
  const auto named = std::count_if(cells.begin(), cells.end(), [](const std::string& cell) {
    return !cell.empty() && cell.size() <= kNameLongest &&
           std::isalpha(static_cast<unsigned char>(cell.front())) != 0;
  });
  return cells.size() >= kColumnsLeast && 10 * named >= 9 * static_cast<long>(cells.size());
}

bool is_time(std::string cell) {
  for (char& c : cell) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return cell == "t" || cell.starts_with("t[") || cell.starts_with("t_") ||
         cell.starts_with("time");
}

// Below the names of a table stand cells, as many: prose and other formats have no such line.
bool row_follows(std::ifstream& file, std::size_t cells, char separator) {
  const std::ifstream::pos_type here = file.tellg();
  std::string line;
  while (std::getline(file, line) && line.empty()) {
  }
  const bool follows = cells_of(line, separator).size() == cells;
  file.clear();
  file.seekg(here);
  return follows;
}

// "; it looks like a table of ..."; empty where the beginning of the file does not look like one.
std::string table_hint(const std::string& path) {
  std::error_code none;
  if (!std::filesystem::is_regular_file(path, none)) return {};  // a pipe cannot be read twice
  std::ifstream file(path, std::ios::binary);
  std::string line;
  for (int i = 0; i < kLinesLooked && std::getline(file, line); ++i) {
    if (line.empty() || line.front() == '#') continue;
    for (const char separator : {',', ';', '\t'}) {
      const std::vector<std::string> cells = cells_of(line, separator);
      if (!is_head(cells) || !row_follows(file, cells.size(), separator)) continue;
      const bool timed = std::any_of(cells.begin(), cells.end(), is_time);
      return "; it looks like a table of " + std::to_string(cells.size()) + " signals" +
             (timed ? "" : " without a time column") + ": expected a " + kLogKinds;
    }
  }
  return {};
}

std::string unit_of(const can::LogStats& stats, std::uint64_t count) {
  return std::string(stats.binary ? " record" : " line") + (count == 1 ? "" : "s");
}

std::string first_of(const can::LogStats& stats) {
  if (stats.first_bad.empty()) return {};
  const can::BadLine& first = stats.first_bad.front();
  return (first.line > 0 ? ", line " : ", ") + first.place() + ": " + first.reason;
}

}  // namespace

std::string no_frame_text(const std::string& path, const can::LogStats& stats) {
  const std::string text = path + ": no readable frame in " + std::to_string(stats.lines) +
                           unit_of(stats, stats.lines) + first_of(stats);
  return stats.binary ? text : text + table_hint(path);
}

std::string bad_line_text(const std::string& path, const can::BadLine& bad) {
  return path + (bad.line > 0 ? ":" : ": ") + bad.place() + ": " + bad.reason;
}

std::string left_out_text(std::uint64_t frames) {
  return std::to_string(frames) +
         " frames left out, their time stamps are far from their neighbours'";
}

std::string unreadable_text(const can::LogStats& stats) {
  return std::to_string(stats.lines_bad) + " unreadable" + unit_of(stats, stats.lines_bad);
}

std::string unreadable_with_first(const can::LogStats& stats) {
  return unreadable_text(stats) + first_of(stats);
}

}  // namespace beltgrip::cli
