#include "daemon/core/config/toml/config_errors.h"

#include <algorithm>
#include <cstdint>

#include "daemon/core/config/toml/config_document.h"

namespace beltgrip::daemon {

namespace {

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      row[j] = std::min({above + 1, row[j - 1] + 1, replaced});
      diagonal = above;
    }
  }
  return row[b.size()];
}

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  return result;
}

}  // namespace

void ConfigErrors::add(std::uint32_t line, const std::string& key, const std::string& found,
                       const std::string& expected, int exit_code) {
  errors_.push_back(
      {exit_code, place(line) + ": " + key + ": found " + found + ", expected " + expected});
}

void ConfigErrors::add_of_file(const std::string& file, const std::string& found,
                               const std::string& expected, int exit_code) {
  errors_.push_back({exit_code, file + ": found " + found + ", expected " + expected});
}

std::string ConfigErrors::place(std::uint32_t line) const {
  const std::string& file = files_[std::min<std::size_t>(line >> kLineBits, files_.size() - 1)];
  return file + ":" + std::to_string(std::max(line & (kFirstLine - 1), 1U));
}

std::uint32_t ConfigErrors::add_file(const std::string& file) {
  files_.push_back(file);
  return static_cast<std::uint32_t>(files_.size() - 1) * kFirstLine;
}

std::string key_of(std::string_view table, std::string_view key) {
  return std::string(table) + "." + std::string(key);
}

std::string nearest_hint(std::string_view name, const std::vector<std::string>& names) {
  constexpr std::size_t kNameMax = 128;  // chosen: a DBC name has 32, and the cost is its square
  if (name.size() > kNameMax) return {};
  const std::string wanted = lower(name);
  std::size_t best_distance = 3 + name.size() / 4;
  const std::string* best = nullptr;
  for (const std::string& candidate : names) {
    if (candidate.size() > kNameMax) continue;
    const std::size_t distance = edit_distance(wanted, lower(candidate));
    if (distance < best_distance) {
      best_distance = distance;
      best = &candidate;
    }
  }
  return best == nullptr ? std::string() : "; nearest is " + in_quotes(*best);
}

}  // namespace beltgrip::daemon
