#include "daemon/core/config/load/signal_catalogue.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <map>

#include "can_dbc/dbc/message_index.h"
#include "can_dbc/dbc/parser.h"

namespace beltgrip::daemon {

namespace {

constexpr std::size_t kWarningsPerFile = 10;
constexpr std::size_t kDbcSizeMax = std::size_t{256} << 20;

// "0x123" or "0x12345678x" (29 bit); nothing if it is not a number that fits.
std::optional<can::CanId> parse_id(std::string_view text) {
  text.remove_prefix(2);
  can::CanId id;
  id.extended = !text.empty() && (text.back() == 'x' || text.back() == 'X');
  if (id.extended) text.remove_suffix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), id.value, 16);
  const std::uint32_t maximum = id.extended ? can::kExtendedIdMax : can::kStandardIdMax;
  if (error != std::errc() || end != text.data() + text.size() || id.value > maximum) return {};
  return id;
}

}  // namespace

std::string id_text(can::CanId id) {
  std::array<char, 16> digits;
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), id.value, 16).ptr;
  return "0x" + std::string(digits.data(), end) + (id.extended ? "x" : "");
}

void SignalCatalogue::add_file(const std::string& key, const std::string& path,
                               const std::string& directory, std::uint32_t line,
                               ConfigErrors& errors, std::vector<std::string>& warnings) {
  const std::string full = (std::filesystem::path(directory) / path).string();
  Result<std::string, Unreadable> text = read_text_file(full, kDbcSizeMax, kind_);
  if (text && text->size() > kDbcSizeMax) text = Unreadable{"it is larger than 256 MiB"};
  if (!text) {
    errors.add(line, key, in_quotes(path) + " that cannot be read (" + text.error().reason + ")",
               "the path of a DBC file, relative to " + (directory.empty() ? "." : directory),
               kNoInput);
    complete_ = false;
    return;
  }
  can::DbcParseResult parsed = can::parse_dbc(*std::move(text));
  if (parsed.database.messages.empty()) {
    std::string why = "no message in it";
    if (!parsed.problems.empty()) {
      const can::Problem& first = parsed.problems.front();
      why = "line " + std::to_string(first.line) + ": " + first.text;
    }
    errors.add(line, key, in_quotes(path) + " without a readable message (" + why + ")",
               "a DBC file", kBadInput);
    complete_ = false;
    return;
  }
  std::size_t problems = 0;
  for (const can::Problem& problem : parsed.problems) {
    if (problem.severity != can::Severity::kError) continue;
    if (problems++ < kWarningsPerFile) {
      warnings.push_back(full + ":" + std::to_string(problem.line) + ":" +
                         std::to_string(problem.column) + ": " + problem.text);
    }
  }
  if (problems > kWarningsPerFile) {
    warnings.push_back(full + ": " + std::to_string(problems - kWarningsPerFile) +
                       " more; see beltgrip dbc check");
  }
  files_.push_back({path, std::move(parsed.database)});
}

void SignalCatalogue::check_identifiers(const std::string& key, std::uint32_t line,
                                        ConfigErrors& errors) const {
  std::map<can::CanId, std::pair<const File*, const can::MessageDef*>> seen;
  std::size_t clashes = 0;
  std::string first;
  for (const File& file : files_) {
    for (const can::MessageDef& message : file.database.messages) {
      const auto [at, fresh] = seen.try_emplace(message.id, &file, &message);
      if (fresh || at->second.first == &file) continue;
      if (clashes++ == 0) {
        first = "identifier " + id_text(message.id) + " in " + in_quotes(at->second.first->path) +
                " (" + at->second.second->name + ") and in " + in_quotes(file.path) + " (" +
                message.name + ")";
      }
    }
  }
  if (clashes == 0) return;
  if (clashes > 1) first += " and " + std::to_string(clashes - 1) + " more such";
  errors.add(line, key, first, "each identifier in one file only");
}

const can::SignalDef* SignalCatalogue::find_signal(std::string_view name) const {
  const std::size_t dot = std::min(name.find('.'), name.size());
  for (const File& file : files_) {
    const can::MessageDef* message = file.database.find_message(std::string(name.substr(0, dot)));
    if (message == nullptr || dot == name.size()) continue;
    return message->find_signal(std::string(name.substr(dot + 1)));
  }
  return nullptr;
}

std::vector<std::string> SignalCatalogue::message_names() const {
  std::vector<std::string> names;
  for (const File& file : files_) {
    for (const can::MessageDef& message : file.database.messages) names.push_back(message.name);
  }
  return names;
}

std::bitset<256> SignalCatalogue::sources_of(const can::MessageDef& message) const {
  constexpr std::uint32_t kSourceMask = 0xFF;
  std::bitset<256> sources;
  if (!message.j1939) return sources;
  std::vector<const can::Database*> databases;
  databases.reserve(files_.size());
  for (const File& file : files_) databases.push_back(&file.database);
  const can::MessageIndex index(databases);
  for (std::uint32_t source = 0; source < sources.size(); ++source) {
    const std::uint32_t id = (message.id.value & ~kSourceMask) | source;
    const can::MessageIndex::Entry* entry = index.lookup({id, true});
    sources[source] =
        entry != nullptr && &files_[entry->database].database.messages[entry->message] == &message;
  }
  sources.set(message.id.value & kSourceMask);  // of two messages of one identifier, either
  return sources;
}

std::optional<SignalCatalogue::Found> SignalCatalogue::find_message(std::string_view name,
                                                                    const std::string& key,
                                                                    std::uint32_t line,
                                                                    ConfigErrors& errors) const {
  const bool by_id = name.starts_with("0x") || name.starts_with("0X");
  const std::optional<can::CanId> id = by_id ? parse_id(name) : std::nullopt;
  if (by_id && !id) {
    errors.add(line, key, "message " + in_quotes(name),
               "an identifier such as 0x123 (11 bit) or 0x12345678x (29 bit)");
    return {};
  }
  Found found;
  for (const File& file : files_) {
    const can::MessageDef* message =
        id ? file.database.find_message(*id) : file.database.find_message(std::string(name));
    if (message == nullptr) continue;
    if (found.message != nullptr && found.message->id != message->id) {
      errors.add(
          line, key,
          "message " + in_quotes(name) + " in " + in_quotes(found.file->path) + " and in " +
              in_quotes(file.path),
          "its identifier instead: " + id_text(found.message->id) + " or " + id_text(message->id));
      return {};
    }
    if (found.message == nullptr) found = {&file, message};
  }
  if (found.message == nullptr) {
    errors.add(line, key, "message " + in_quotes(name) + " that no DBC names",
               "a message of the DBC files" + (by_id ? "" : nearest_hint(name, message_names())));
    return {};
  }
  return found;
}

}  // namespace beltgrip::daemon
