#include "daemon/core/config/load/config_include.h"

#include <algorithm>
#include <filesystem>
#include <iterator>

#include "daemon/core/config/options/config_options.h"

namespace beltgrip::daemon {

namespace {

// Chosen, each far beyond what a person writes: what a wrong path (/dev/zero) or a circle may cost.
constexpr std::size_t kSizeMax = std::size_t{1} << 20;  // of a configuration, with all its files
constexpr std::size_t kIncludeDepthMax = 8;             // files within each other
constexpr std::size_t kIncludedMax = 64;

// `above` over `below`, both sorted by key, as the result: one pass over both. Where both have a
// key, meet(lower, upper) leaves in the lower one what counts.
template <typename Meet>
void merge_sorted(std::vector<TomlNode>& below, std::vector<TomlNode>& above, Meet meet) {
  std::vector<TomlNode> all;
  all.reserve(below.size() + above.size());
  auto lower = below.begin();
  for (TomlNode& upper : above) {
    while (lower != below.end() && lower->key < upper.key) all.push_back(std::move(*lower++));
    if (lower == below.end() || lower->key != upper.key) {
      all.push_back(std::move(upper));
    } else {
      meet(*lower, upper);
      all.push_back(std::move(*lower++));
    }
  }
  std::move(lower, below.end(), std::back_inserter(all));
  below = std::move(all);
}

class DocumentReader {
 public:
  DocumentReader(const ConfigFile& file, std::vector<std::string>& files, ConfigErrors& errors,
                 std::vector<std::string>& warnings)
      : directory_(std::filesystem::path(file.path).parent_path().string()),
        kind_(file.kind),
        files_(files),
        errors_(errors),
        warnings_(warnings) {}

  bool read_file(const std::string& path, const std::string& shown, const std::string& folder,
                 std::uint32_t first_line, std::uint32_t included_at, TomlNode& root);

 private:
  bool read_included(const std::string& path, const std::string& folder, TomlNode& own,
                     TomlNode& root);
  struct Included {
    std::string text;  // the path as it is shown
    std::uint32_t line;
  };
  std::vector<Included> included(const TomlNode& include, const std::string& folder);
  static void count_lines_from(std::uint32_t first_line, TomlNode& node);
  static void see_from(const std::string& folder, TomlNode& root);
  void put_over(TomlNode& own, TomlNode& root);

  std::string directory_;
  FileKind kind_;
  std::vector<std::string>& files_;
  ConfigErrors& errors_;
  std::vector<std::string>& warnings_;
  std::vector<std::string> reading_;  // the file that is read, and those that include it
  std::size_t included_ = 0;
  std::size_t size_ = 0;  // of all that was read
};

// One file, with what it includes under it. path: to open; shown: in errors; folder: of it, seen
// from that of the configuration; first_line: what its lines are counted from.
bool DocumentReader::read_file(const std::string& path, const std::string& shown,
                               const std::string& folder, std::uint32_t first_line,
                               std::uint32_t included_at, TomlNode& root) {
  const Result<std::string, Unreadable> found = read_text_file(path, kSizeMax - size_, kind_);
  if (!found && included_at != 0) {
    errors_.add(included_at, "include",
                in_quotes(shown) + " that cannot be read (" + found.error().reason + ")",
                "the path of a configuration", kNoInput);
    return false;
  }
  if (!found) {
    errors_.add_of_file(path, "no readable file (" + found.error().reason + ")",
                        "a configuration in TOML", kNoInput);
    return false;
  }
  const std::string& text = *found;
  if (text.size() > kSizeMax - size_) {
    errors_.add(first_line + 1, "size",
                included_at == 0 ? "more than 1 MiB" : "more than 1 MiB with the files before it",
                "a configuration in TOML");
    return false;
  }
  size_ += text.size();
  auto parsed = parse_toml(text);
  if (!parsed) {
    const TomlSyntaxError& error = parsed.error();
    errors_.add(first_line + error.line, "syntax", in_quotes(error.text), "TOML");
    return false;
  }
  TomlNode own = *std::move(parsed);
  count_lines_from(first_line, own);
  if (included_at != 0) see_from(folder, own);
  files_.push_back(path);
  bool good = read_included(path, folder, own, root);
  put_over(own, root);
  return good;
}

bool DocumentReader::read_included(const std::string& path, const std::string& folder,
                                   TomlNode& own, TomlNode& root) {
  const auto at = std::find_if(own.children.begin(), own.children.end(),
                               [](const TomlNode& child) { return child.key == "include"; });
  if (at == own.children.end()) return true;
  const TomlNode include = std::move(*at);
  own.children.erase(at);
  namespace fs = std::filesystem;
  std::error_code ignored;
  reading_.push_back(fs::weakly_canonical(path, ignored).string());
  const std::size_t errors_before = errors_.count();
  if (include.type != TomlType::kArray) {
    errors_.add(include.line, "include", include.found(), "an array: [\"other.toml\"]");
  }
  for (const Included& each : included(include, folder)) {
    const std::string inner = (fs::path(folder) / each.text).string();
    const std::string file = (fs::path(directory_) / inner).string();
    const std::string canonical = fs::weakly_canonical(file, ignored).string();
    if (std::find(reading_.begin(), reading_.end(), canonical) != reading_.end()) {
      errors_.add(each.line, "include", in_quotes(each.text) + ", which includes this file",
                  "files without a circle");
    } else if (reading_.size() > kIncludeDepthMax || ++included_ > kIncludedMax) {
      errors_.add(each.line, "include", "more than 8 files within each other or 64 in all",
                  "fewer");
      break;
    } else {
      read_file(file, each.text, fs::path(inner).parent_path().string(), errors_.add_file(file),
                each.line, root);
    }
  }
  reading_.pop_back();
  return errors_.count() == errors_before;
}

// The files that an array names, in its order: "conf.d/*.toml" stands for all of that folder, by
// name. None is fine; a folder that is not there is not.
std::vector<DocumentReader::Included> DocumentReader::included(const TomlNode& include,
                                                               const std::string& folder) {
  namespace fs = std::filesystem;
  constexpr const char* kAll = "*.toml";
  std::vector<Included> all;
  for (const TomlNode& each : include.children) {
    if (each.type != TomlType::kText || each.text.empty()) {
      errors_.add(each.line, "include", each.found(), "the path of a configuration in quotes");
      continue;
    }
    const fs::path path(each.text);
    if (path.filename() != kAll) {
      all.push_back({each.text, each.line});
      continue;
    }
    std::error_code error;
    fs::directory_iterator entry(fs::path(directory_) / folder / path.parent_path(), error);
    if (error) {
      errors_.add(each.line, "include",
                  in_quotes(each.text) + ", whose folder cannot be read (" + error.message() + ")",
                  "a folder of configurations", kNoInput);
      continue;
    }
    std::vector<std::string> names;
    for (; entry != fs::directory_iterator(); entry.increment(error)) {
      const std::string name = entry->path().filename().string();
      if (name.ends_with(".toml") && name.front() != '.') names.push_back(name);
    }
    std::sort(names.begin(), names.end());
    for (const std::string& name : names) {
      all.push_back({(path.parent_path() / name).string(), each.line});
    }
  }
  return all;
}

void DocumentReader::count_lines_from(std::uint32_t first_line, TomlNode& node) {
  node.line += first_line;
  for (TomlNode& child : node.children) count_lines_from(first_line, child);
}

// Paths are relative to the file that they stand in.
void DocumentReader::see_from(const std::string& folder, TomlNode& root) {
  const auto turn = [&](TomlNode& node) {
    if (node.type == TomlType::kText) {
      node.text = (std::filesystem::path(folder) / node.text).string();
    }
  };
  const auto turn_all = [&](const auto& options, std::string_view section, TomlNode& table) {
    for (const OptionRow& option : options) {
      if (!option.is_path || option.section != section) continue;
      for (TomlNode& node : table.children) {
        if (node.key != option.key) continue;
        if (!node.text.empty()) turn(node);
        for (TomlNode& each : node.children) turn(each);
      }
    }
  };
  for (TomlNode& section : root.children) {
    turn_all(option_table(), section.key, section);
    if (section.key != "bus") continue;
    for (TomlNode& node : section.children) {
      if (node.type == TomlType::kTable) turn_all(further_bus_options(), "bus.NAME", node);
    }
  }
}

// Later keys win, one by one in each section; what is replaced is told, with both places.
void DocumentReader::put_over(TomlNode& own, TomlNode& root) {
  merge_sorted(root.children, own.children, [&](TomlNode& before, TomlNode& section) {
    if (before.type != TomlType::kTable || section.type != TomlType::kTable) {
      before = std::move(section);
      return;
    }
    before.line = section.line;
    merge_sorted(before.children, section.children, [&](TomlNode& replaced, TomlNode& node) {
      warnings_.push_back(errors_.place(node.line) + ": " + section.key + "." + node.key +
                          " takes the place of " + errors_.place(replaced.line));
      replaced = std::move(node);
    });
  });
}

}  // namespace

bool read_document(const ConfigFile& file, TomlNode& root, std::vector<std::string>& files,
                   ConfigErrors& errors, std::vector<std::string>& warnings) {
  return DocumentReader(file, files, errors, warnings)
      .read_file(file.path, file.path, "", 0, 0, root);
}

}  // namespace beltgrip::daemon
