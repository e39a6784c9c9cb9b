#include "tests/arch/tree_check.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <span>

namespace beltgrip::test {
namespace {

// Which folders and files of this project a folder may include. The first row whose prefix fits
// the including file counts.
struct LayerRule {
  std::string_view prefix;
  std::vector<std::string_view> may_include;
};
const std::array kLayers{
    LayerRule{"can_dbc/", {"can_dbc/"}},
    LayerRule{"estimator/", {"estimator/"}},
    // Judge from signals and bytes alone.
    LayerRule{"daemon/core/guard/tx_gate.",
              {"can_dbc/frame/", "daemon/core/guard/tx_gate.h", "daemon/core/base/"}},
    LayerRule{"daemon/core/guard/safety_monitor.",
              {"daemon/core/guard/safety_monitor.h", "daemon/core/base/"}},
    LayerRule{"daemon/core/", {"can_dbc/", "estimator/", "daemon/core/"}},
    LayerRule{"daemon/io/", {"can_dbc/", "estimator/", "daemon/core/", "daemon/io/"}},
    LayerRule{"daemon/", {"can_dbc/", "estimator/", "daemon/"}},
    // The truth shares nothing with the estimator but the geometry.
    LayerRule{"tools/sim/",
              {"can_dbc/", "estimator/physics/variator_geometry.h",
               "estimator/physics/parameters.h", "estimator/physics/machine_effects.h",
               "estimator/physics/learned_term.h", "estimator/physics/learned_effects.h",
               "daemon/core/base/port.h", "daemon/core/base/mono_time.h", "tools/sim/"}},
    LayerRule{"tools/", {"can_dbc/", "estimator/", "daemon/", "tools/"}},
    LayerRule{"tests/", {"can_dbc/", "estimator/", "daemon/", "tools/", "tests/"}},
};
constexpr std::array<std::string_view, 5> kProjectFolders{"can_dbc/", "estimator/", "daemon/",
                                                          "tools/", "tests/"};

// What may stand at the top of the tree, beside names that begin with a dot.
constexpr std::array<std::string_view, 9> kTop{"CMakeLists.txt", "LICENSE", "README.md",
                                               "can_dbc/",       "daemon/", "estimator/",
                                               "systemd/",       "tests/",  "tools/"};

// A pattern that must not stand in the code of some files.
struct TextRule {
  std::vector<std::string_view> prefixes;  // files it holds for: prefixes of their paths
  std::vector<std::string_view> except;    // and these it does not
  std::string_view pattern;
  std::string_view why;
};
const std::array kCodeRules{
    TextRule{{"can_dbc/", "estimator/", "daemon/core/"},
             {"can_dbc/log/byte_source.cpp"},  // reads logs from pipes as they come
             R"(#include\s*<(sys/|linux/|net/|netinet/|unistd\.h|poll\.h|fcntl\.h|pthread\.h))",
             "no system calls here"},
    TextRule{
        {"can_dbc/", "estimator/", "daemon/core/"},
        {},
        R"(\b(clock_gettime|gettimeofday|nanosleep|usleep|sleep_for|sleep_until|system_clock|steady_clock|high_resolution_clock)\b|#include\s*<(chrono|ctime|time\.h|thread|mutex|condition_variable)>|[^\w.]time\s*\(\s*(nullptr|NULL|0)\s*\))",
        "time comes from the port, and there are no threads here"},
    TextRule{{"can_dbc/", "estimator/", "daemon/core/"},
             {},
             R"(#include\s*<(spdlog|systemd|libsocketcan|sqlite3|libsocketcan\.h|fmt)\b)",
             "no logging and no services below daemon/io"},
    TextRule{{"can_dbc/", "estimator/", "daemon/", "tools/"},
             {},
             R"(\b(strtod|strtof|atof|stod|stof|sscanf|setlocale|istringstream)\b)",
             "numbers are read by std::from_chars: exact, and free of the locale"},
    TextRule{{"can_dbc/", "estimator/", "daemon/", "tools/"},
             // the daemon's, and the port that hands on to one of two buses; a trace's player
             {"daemon/core/loop/loop.cpp", "daemon/io/socket_port.cpp", "tools/cli/bus.cpp"},
             R"((\.|->)\s*send(_on)?\s*\()",
             "one place sends"},
    TextRule{{"can_dbc/", "estimator/", "daemon/", "tools/"},
             {"daemon/io/can_socket.cpp"},
             R"(\b(sendmsg|sendmmsg|sendto|pwrite|writev)\s*\(|(^|[^\w>])::write\s*\()",
             "one place writes to a socket"},
    // So the force that is asked for never passes through a report, and nothing decides by one.
    TextRule{{"daemon/core/input/", "daemon/core/estimate/", "daemon/core/experiment/",
              "daemon/core/guard/", "daemon/core/publish/"},
             {},
             R"(\bSampleReport\b|#include\s*"daemon/core/(loop|observe)/)",
             "a sample's report is put together last, and no stage knows it"},
    TextRule{{"daemon/core/loop/pipeline", "daemon/core/loop/loop."},
             {},
             R"(\breport(\(\)|_)?\.\w+\s*(?![\w.\s]*=[^=]))",
             "a sample's report is written here and read by nobody"},
    TextRule{
        {"estimator/", "daemon/core/"},
        // Start-up only; constructors and factories elsewhere say std::make_unique.
        {"daemon/core/config/", "daemon/core/publish/own_frames.cpp"},
        R"(\bnew\b|\b(malloc|calloc|realloc|strdup)\s*\(|\b(make_shared|push_back|emplace_back|resize|reserve|to_string|stringstream)\b|\bstd::(function|mutex|deque|list|map|set|unordered_map|shared_ptr)\b|\bthrow\b)",
        "nothing allocates, locks or throws on the real-time path"},
};

// Patterns that must not stand in the text of some files.
const std::array kTextRules{
    // One program on every machine: what is not installed is demanded, by a name or by an option.
    TextRule{{"can_dbc/", "estimator/", "daemon/", "tools/", "tests/"},
             {},
             R"(^[ \t]*#[ \t]*(if|elif).*__has_include)",
             "no code that depends on what happens to be installed"},
    TextRule{
        {"CMakeLists.txt", "can_dbc/", "estimator/", "daemon/", "tools/", "tests/", "systemd/"},
        {},
        R"(^[ \t]*find_package\([^)]*\b(QUIET|OPTIONAL_COMPONENTS)\b|^[ \t]*pkg_(check|search)_module[s]?\((?![^)]*REQUIRED))",
        "a package is demanded or not used"},
};

// Patterns that must not stand in any file; written in pieces so that they do not find themselves.
struct AnywhereRule {
  std::string pattern;
  std::string_view why;
};
const std::array kAnywhereRules{
    AnywhereRule{std::string("(deb|security|snapshot|ftp)\\.") + "debian\\.org|registry\\." +
                     "npmjs|files\\." + "pythonhosted|pypi\\." + "org|proxy\\." +
                     "golang|crates\\." + "io",
                 "no names of package hosts"},
    AnywhereRule{std::string("(^|[^\\w.])/(") + "work|farm|root/wt)/", "no paths of one workplace"},
};

bool starts_with_any(std::string_view path, std::span<const std::string_view> prefixes) {
  return std::any_of(prefixes.begin(), prefixes.end(),
                     [&](std::string_view prefix) { return path.starts_with(prefix); });
}

bool is_cpp(std::string_view path) {
  return path.ends_with(".h") || path.ends_with(".cpp") || path.ends_with(".h.in");
}

std::string at_line(const SourceFile& file, const std::string& text, std::ptrdiff_t position) {
  const auto line = 1 + std::count(text.begin(), text.begin() + position, '\n');
  return file.path + ":" + std::to_string(line) + ": ";
}

void find_all(const SourceFile& file, const std::string& text, const std::string& pattern,
              std::string_view why, std::vector<std::string>& found) {
  const std::regex regex(pattern, std::regex::ECMAScript | std::regex::multiline);
  for (std::sregex_iterator each(text.begin(), text.end(), regex), end; each != end; ++each) {
    found.push_back(at_line(file, text, each->position()) + each->str() + " (" + std::string(why) +
                    ")");
  }
}

void check_includes(const SourceFile& file, const std::string& code,
                    std::vector<std::string>& found) {
  const auto layer = std::find_if(kLayers.begin(), kLayers.end(), [&](const LayerRule& rule) {
    return file.path.starts_with(rule.prefix);
  });
  if (layer == kLayers.end()) return;
  static const std::regex include("#\\s*include\\s*[<\"]([^>\"]+)[>\"]");
  for (std::sregex_iterator each(code.begin(), code.end(), include), end; each != end; ++each) {
    const std::string name = (*each)[1];
    if (starts_with_any(name, kProjectFolders) && !starts_with_any(name, layer->may_include)) {
      found.push_back(at_line(file, code, each->position()) + name + " (" +
                      std::string(layer->prefix) + " must not include it)");
    }
  }
}

// The name as a word of its own, not behind a scope or an object, elsewhere than from `begin` to
// `end`.
bool is_used(const std::string& code, const std::string& name, std::size_t begin, std::size_t end) {
  const auto is_word = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) || c == '_';
  };
  for (std::size_t at = code.find(name); at != std::string::npos; at = code.find(name, at + 1)) {
    const std::size_t behind = at + name.size();
    const char before = at == 0 ? ' ' : code[at - 1];
    const bool is_whole = !is_word(before) && (behind == code.size() || !is_word(code[behind]));
    const bool is_bare = before != ':' && before != '.' && before != '>';
    if (is_whole && is_bare && (at < begin || at >= end)) return true;
  }
  return false;
}

// clang-tidy asks this of a source that is compiled alone, not of one of eight.
void check_usings(const SourceFile& file, const std::string& code,
                  std::vector<std::string>& found) {
  static const std::regex declared(
      R"([ \t]*(?:using\s+(?!namespace\b|enum\b)[\w:]+::(\w+)\s*;|namespace\s+(\w+)\s*=).*)");
  for (std::size_t begin = 0, end = 0; begin < code.size(); begin = end + 1) {
    end = std::min(code.find('\n', begin), code.size());
    const std::string line = code.substr(begin, end - begin);
    std::smatch names;
    if (line.find("using ") == std::string::npos && line.find("namespace ") == std::string::npos)
      continue;
    if (!std::regex_match(line, names, declared)) continue;
    const std::string name = names[1].matched ? names[1].str() : names[2].str();
    const std::size_t behind = begin + line.find_first_of(";=") + 1;
    if (!is_used(code, name, begin, behind)) {
      found.push_back(at_line(file, code, static_cast<std::ptrdiff_t>(begin)) + name +
                      " (declared, never used)");
    }
  }
}

}  // namespace

std::string blank_comments_and_strings(std::string_view text) {
  std::string out(text);
  const auto blank = [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to && i < out.size(); ++i) {
      if (out[i] != '\n') out[i] = ' ';
    }
  };
  std::size_t i = 0;
  while (i < text.size()) {
    const bool line_start = i == 0 || text[i - 1] == '\n';
    if (line_start && text.substr(i).starts_with("#include")) {
      i = std::min(text.find('\n', i), text.size());
    } else if (text.substr(i).starts_with("//")) {
      const std::size_t end = std::min(text.find('\n', i), text.size());
      blank(i, end);
      i = end;
    } else if (text.substr(i).starts_with("/*")) {
      const std::size_t close = text.find("*/", i + 2);
      const std::size_t end = close == std::string_view::npos ? text.size() : close + 2;
      blank(i, end);
      i = end;
    } else if (text.substr(i).starts_with("R\"")) {
      const std::size_t open = std::min(text.find('(', i), text.size());
      const std::string close = ")" + std::string(text.substr(i + 2, open - i - 2)) + "\"";
      const std::size_t at = text.find(close, open);
      const std::size_t end = at == std::string_view::npos ? text.size() : at + close.size();
      blank(i + 2, end - 1);
      i = end;
    } else if (text[i] == '"' ||
               (text[i] == '\'' &&
                (i == 0 || !std::isalnum(static_cast<unsigned char>(text[i - 1]))))) {
      std::size_t end = i + 1;
      while (end < text.size() && text[end] != text[i] && text[end] != '\n') {
        end += text[end] == '\\' ? 2 : 1;
      }
      blank(i + 1, end);
      i = end + 1;
    } else {
      ++i;
    }
  }
  return out;
}

std::vector<std::string> check_tree(const std::vector<SourceFile>& files) {
  std::vector<std::string> found;
  for (const SourceFile& file : files) {
    if (!file.path.starts_with(".") && !starts_with_any(file.path, kTop)) {
      found.push_back(file.path + ": not at the top of this tree");
    }
    for (const AnywhereRule& rule : kAnywhereRules) {
      find_all(file, file.text, rule.pattern, rule.why, found);
    }
    for (const TextRule& rule : kTextRules) {
      if (starts_with_any(file.path, rule.prefixes)) {
        find_all(file, file.text, std::string(rule.pattern), rule.why, found);
      }
    }
    if (!is_cpp(file.path)) continue;
    const std::string code = blank_comments_and_strings(file.text);
    check_includes(file, code, found);
    if (file.path.ends_with(".cpp")) check_usings(file, code, found);
    for (const TextRule& rule : kCodeRules) {
      if (starts_with_any(file.path, rule.prefixes) && !starts_with_any(file.path, rule.except)) {
        find_all(file, code, std::string(rule.pattern), rule.why, found);
      }
    }
  }
  return found;
}

std::vector<std::string> documents_named_in(const std::string& text) {
  static const std::regex name("`([A-Za-z0-9_./-]+\\.(md|txt))`");
  std::vector<std::string> found;
  for (std::sregex_iterator each(text.begin(), text.end(), name), end; each != end; ++each) {
    if (std::find(found.begin(), found.end(), (*each)[1].str()) == found.end()) {
      found.push_back((*each)[1]);
    }
  }
  return found;
}

std::vector<SourceFile> read_tree(const std::string& root) {
  namespace fs = std::filesystem;
  std::vector<SourceFile> files;
  for (auto each = fs::recursive_directory_iterator(root);
       each != fs::recursive_directory_iterator(); ++each) {
    const std::string name = each->path().filename();
    if (each->is_directory()) {
      if (name == ".git" || name == ".cache" || name == "__pycache__" ||
          name.starts_with("build")) {
        each.disable_recursion_pending();
      }
      continue;
    }
    if (name == ".git") continue;  // of a further work tree
    std::ifstream in(each->path(), std::ios::binary);
    files.push_back({each->path().lexically_relative(root).generic_string(),
                     {std::istreambuf_iterator<char>(in), {}}});
  }
  std::sort(files.begin(), files.end(),
            [](const SourceFile& a, const SourceFile& b) { return a.path < b.path; });
  return files;
}

}  // namespace beltgrip::test
