#include "daemon/core/config/config_binding.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <map>

#include "can_dbc/dbc/message_index.h"
#include "can_dbc/dbc/parser.h"
#include "daemon/core/config/config_flag.h"
#include "daemon/core/config/config_options.h"
#include "daemon/core/config/config_text.h"
#include "daemon/core/config/config_uds.h"

namespace beltgrip::daemon {

namespace {

constexpr int kExitData = 65;
constexpr int kExitNoInput = 66;
constexpr std::size_t kWarningsPerFile = 10;
constexpr std::size_t kMuxDepth = 16;
constexpr std::size_t kNamedMost = 256;  // values at which a flag is 1
constexpr std::uint32_t kClassicPayload = 8;
constexpr std::size_t kDbcSizeMax = std::size_t{256} << 20;

std::string id_text(can::CanId id) {
  std::array<char, 16> digits;
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), id.value, 16).ptr;
  return "0x" + std::string(digits.data(), end) + (id.extended ? "x" : "");
}

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

// What a role says in its TOML value.
struct RoleText {
  std::string signal;
  std::optional<UdsSource> uds;
  std::string unit;
  bool has_unit = false;
  double scale = 1.0, offset = 0.0;
  std::optional<double> period_ms;
  double delay_ms = 0.0;
  std::optional<TomlNode> true_when;
  std::uint32_t signal_line = 0, unit_line = 0;
};

std::optional<RoleText> read_role(const std::string& key, const TomlNode& node,
                                  ConfigErrors& errors) {
  RoleText text;
  text.signal_line = text.unit_line = node.line;
  if (node.type == TomlType::kText) {
    text.signal = node.text;
    return text;
  }
  if (node.type != TomlType::kTable) {
    errors.add(node.line, key, node.found(), "\"Message.Signal\" or { signal = \"...\", ... }");
    return {};
  }
  static const std::vector<std::string> kKeys{"signal",    "uds",      "unit", "scale",    "offset",
                                              "period_ms", "delay_ms", "bus",  "true_when"};
  bool good = true;
  const auto wrong = [&](const TomlNode& child, const std::string& expected) {
    errors.add(child.line, key + "." + child.key, child.found(), expected);
    good = false;
  };
  for (const TomlNode& child : node.children) {
    if (child.key == "signal") {
      text.signal = child.text;
      text.signal_line = child.line;
      if (child.type != TomlType::kText) wrong(child, "text \"Message.Signal\"");
    } else if (child.key == "uds") {
      text.uds = read_uds(key + ".uds", child, errors);
      good = good && text.uds;
    } else if (child.key == "bus") {
      if (child.type != TomlType::kText) wrong(child, "the name of a bus in quotes");
    } else if (child.key == "unit") {
      text.unit = child.text;
      text.has_unit = true;
      text.unit_line = child.line;
      if (child.type != TomlType::kText) wrong(child, "text such as \"rpm\"");
    } else if (child.key == "true_when") {
      text.true_when = child;
    } else if (child.key == "scale") {
      text.scale = child.number;
      if (!child.is_number() || !std::isfinite(child.number) || child.number == 0.0) {
        wrong(child, "a finite number other than 0");
      }
    } else if (child.key == "offset") {
      text.offset = child.number;
      if (!child.is_number() || !std::isfinite(child.number)) wrong(child, "a finite number");
    } else if (child.key == "period_ms") {
      text.period_ms = child.number;
      if (!child.is_number() || !(child.number >= kPeriodMinimum_ms) ||
          !(child.number <= kPeriodMaximum_ms)) {
        wrong(child, "a number from 0.5 to 10000");
      }
    } else if (child.key == "delay_ms") {
      text.delay_ms = child.number;
      if (!child.is_number() || !(child.number >= kDelayMinimum_ms) ||
          !(child.number <= kDelayMaximum_ms)) {
        wrong(child, "a number from -50 to 200");
      }
    } else {
      errors.add(child.line, key + "." + child.key, "an unknown key",
                 "signal, uds, unit, scale, offset, true_when, period_ms, delay_ms or bus" +
                     nearest_hint(child.key, kKeys));
      good = false;
    }
  }
  const bool by_uds = node.find("uds") != nullptr;
  if (by_uds == (node.find("signal") != nullptr)) {
    errors.add(node.line, key, by_uds ? "both signal and uds" : "a table without signal",
               by_uds ? "one of them" : "signal = \"Message.Signal\"");
    good = false;
  }
  for (const char* each : {"scale", "offset"}) {
    const TomlNode* child = by_uds ? node.find(each) : nullptr;
    if (child == nullptr) continue;
    errors.add(child->line, key + "." + each, "a key beside uds", "it inside uds = { ... }");
    good = false;
  }
  for (const char* each : {"scale", "offset"}) {
    const TomlNode* child = text.true_when ? node.find(each) : nullptr;
    if (child == nullptr) continue;
    errors.add(child->line, key + "." + each, "a key beside true_when", "one of them");
    good = false;
  }
  return good ? std::optional(text) : std::nullopt;
}

// The raw values at which a flag is 1: texts or numbers of the signal's value table. False when
// errors were added.
bool read_true_when(Role role, const std::string& key, const TomlNode& node,
                    const can::SignalDef& signal, std::vector<std::int64_t>& values,
                    ConfigErrors& errors) {
  std::vector<std::string> labels;
  for (const auto& [number, label] : signal.values) labels.push_back(label);
  const std::string where = key + ".true_when";
  const auto wrong = [&](const TomlNode& child, const std::string& expected) {
    errors.add(child.line, where, child.found(), expected);
    return false;
  };
  if (role_dimension(role) != can::Dimension::kNone) {
    return wrong(node, "no such key: " + std::string(role_name(role)) + " is no flag");
  }
  if (signal.type != can::ValueType::kUnsigned && signal.type != can::ValueType::kSigned) {
    return wrong(node, "a signal that is no floating-point number");
  }
  const bool is_list = node.type == TomlType::kArray;
  const std::vector<TomlNode> all = is_list ? node.children : std::vector<TomlNode>{node};
  if (all.empty() || all.size() > kNamedMost) {
    return wrong(node, "a text or a number of the value table, or several");
  }
  for (const TomlNode& each : all) {
    const std::size_t before = values.size();
    const RawRange range = raw_range(signal);
    for (const auto& [number, label] : signal.values) {
      if (number < range.low || number > range.high) continue;
      const bool same = each.type == TomlType::kText
                            ? label == each.text
                            : each.type == TomlType::kInteger && number == each.integer;
      if (same) values.push_back(number);
    }
    if (values.size() > before) continue;
    const bool fits = each.integer >= range.low && each.integer <= range.high;
    if (signal.values.empty() && each.type == TomlType::kInteger && fits) {
      values.push_back(each.integer);
      continue;
    }
    return wrong(each, signal.values.empty() ? "a raw value from " + raw_range_text(signal) +
                                                   ": the signal has no value table"
                                             : "a text or a number of the signal's value table" +
                                                   nearest_hint(each.text, labels));
  }
  // Each frame is compared with them.
  if (values.size() > kNamedMost) return wrong(node, "at most 256 values");
  return true;
}

// A flag that never changes is no flag. False when errors were added.
bool check_flag(const std::string& key, const RoleText& text, const RoleBinding& binding,
                const can::SignalDef& signal, ConfigErrors& errors) {
  if (role_dimension(binding.role) != can::Dimension::kNone) return true;
  const FlagValues values = flag_values(binding, signal);
  if (values.zero && values.one) return true;
  const std::string never = std::string("a flag that is never ") + (values.zero ? "1" : "0");
  if (text.true_when) {
    errors.add(text.true_when->line, key + ".true_when", never, "some of the signal's raw values");
  } else {
    errors.add(text.signal_line, key, never,
               "a signal, or a scale and an offset for it, that is 0 and 1 at raw values of its "
               "range; or true_when");
  }
  return false;
}

// The unit of a role; nothing when errors were added.
std::optional<can::Unit> role_unit(Role role, const std::string& key, const RoleText& text,
                                   const can::SignalDef& signal, const std::string& dbc_path,
                                   ConfigErrors& errors) {
  const can::Dimension dimension = role_dimension(role);
  const std::string& unit_text = text.has_unit ? text.unit : signal.unit;
  const std::optional<can::Unit> unit = can::parse_unit(unit_text);
  const std::string where = text.has_unit || dbc_path.empty() ? "" : " in " + dbc_path;
  const std::string found =
      unit_text.empty() ? "no unit" + where : "unit " + in_quotes(unit_text) + where;
  if (dimension == can::Dimension::kNone) {
    if (unit && unit->dimension != can::Dimension::kNone) {
      errors.add(text.unit_line, key,
                 found + " (" + std::string(can::dimension_name(unit->dimension)) + ")",
                 "a signal without unit, 0 or 1");
      return {};
    }
    return can::Unit{};
  }
  const std::string wanted = "a unit of " + std::string(can::dimension_name(dimension)) +
                             " such as " + std::string(can::si_unit_text(dimension));
  const std::string hint = text.has_unit ? ""
                           : text.uds    ? "; set unit in { uds = { ... }, unit = \"...\" }"
                                         : "; set unit in { signal = \"...\", unit = \"...\" }";
  if (!unit || unit->dimension == can::Dimension::kNone) {
    errors.add(text.unit_line, key, found, wanted + hint);
    return {};
  }
  if (unit->dimension != dimension) {
    errors.add(text.unit_line, key,
               found + " (" + std::string(can::dimension_name(unit->dimension)) + ")",
               wanted + hint);
    return {};
  }
  return unit;
}

std::string signal_text(const can::SignalDef& signal) {
  return std::to_string(signal.start_bit) + "|" + std::to_string(signal.length) +
         (signal.byte_order == can::ByteOrder::kBig ? "@0" : "@1") +
         (signal.type == can::ValueType::kSigned ? "-" : "+");
}

std::optional<RoleBinding> bind_uds(Role role, const std::string& key, const RoleText& text,
                                    const UdsSource& source, ConfigErrors& errors) {
  const can::SignalDef& signal = source.signal;
  const std::optional<can::Unit> unit = role_unit(role, key, text, signal, "", errors);
  if (!unit) return {};
  RoleBinding binding;
  binding.role = role;
  binding.uds = source;
  binding.id = source.response;
  binding.message_name = id_text(source.response);
  binding.signal_name = "did " + id_text({source.identifier, false}) + " " + signal_text(signal);
  binding.codec = can::SignalCodec(signal);
  if (text.true_when &&
      !read_true_when(role, key, *text.true_when, signal, binding.true_when, errors)) {
    return {};
  }
  binding.unit = text.unit;
  binding.factor = unit->factor;
  binding.shift = unit->offset;
  binding.period_ms = text.period_ms;
  binding.delay_ms = text.delay_ms;
  if (!check_flag(key, text, binding, signal, errors)) return {};
  return binding;
}

}  // namespace

void ConfigErrors::add(std::uint32_t line, const std::string& key, const std::string& found,
                       const std::string& expected, int exit_code) {
  errors_.push_back(
      {exit_code, place(line) + ": " + key + ": found " + found + ", expected " + expected});
}

std::string ConfigErrors::place(std::uint32_t line) const {
  const std::string& file = files_[std::min<std::size_t>(line >> kLineBits, files_.size() - 1)];
  return file + ":" + std::to_string(std::max(line & (kFirstLine - 1), 1U));
}

std::uint32_t ConfigErrors::add_file(const std::string& file) {
  files_.push_back(file);
  return static_cast<std::uint32_t>(files_.size() - 1) * kFirstLine;
}

std::string nearest_hint(std::string_view name, const std::vector<std::string>& names) {
  constexpr std::size_t kNameMax = 128;
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

void SignalCatalogue::add_file(const std::string& key, const std::string& path,
                               const std::string& directory, std::uint32_t line,
                               ConfigErrors& errors, std::vector<std::string>& warnings) {
  const std::string full = (std::filesystem::path(directory) / path).string();
  std::string text;
  std::string reason = read_text_file(full, kDbcSizeMax, kind_, text);
  if (text.size() > kDbcSizeMax) reason = "it is larger than 256 MiB";
  if (!reason.empty()) {
    errors.add(line, key, in_quotes(path) + " that cannot be read (" + reason + ")",
               "the path of a DBC file, relative to " + (directory.empty() ? "." : directory),
               kExitNoInput);
    complete_ = false;
    return;
  }
  can::DbcParseResult parsed = can::parse_dbc(text);
  if (parsed.database.messages.empty()) {
    std::string why = "no message in it";
    if (!parsed.problems.empty()) {
      const can::Problem& first = parsed.problems.front();
      why = "line " + std::to_string(first.line) + ": " + first.text;
    }
    errors.add(line, key, in_quotes(path) + " without a readable message (" + why + ")",
               "a DBC file", kExitData);
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
    const can::MessageIndex::Place* place = index.lookup({id, true});
    sources[source] =
        place != nullptr && &files_[place->database].database.messages[place->message] == &message;
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

std::optional<RoleBinding> SignalCatalogue::bind(Role role, const TomlNode& node,
                                                 ConfigErrors& errors) const {
  const std::string key = "signals." + std::string(role_name(role));
  const std::optional<RoleText> text = read_role(key, node, errors);
  if (!text) return {};
  if (text->uds) return bind_uds(role, key, *text, *text->uds, errors);
  const std::size_t dot = text->signal.find('.');
  if (dot == std::string::npos || dot == 0 || dot + 1 == text->signal.size()) {
    errors.add(text->signal_line, key, in_quotes(text->signal),
               "\"Message.Signal\", \"0x123.Signal\" or \"0x12345678x.Signal\"");
    return {};
  }
  const std::optional<Found> found =
      find_message(std::string_view(text->signal).substr(0, dot), key, text->signal_line, errors);
  if (!found) return {};
  const can::MessageDef& message = *found->message;
  const std::string signal_name = text->signal.substr(dot + 1);
  const can::SignalDef* signal = message.find_signal(signal_name);
  if (signal == nullptr) {
    std::vector<std::string> names;
    names.reserve(message.signals.size());
    for (const can::SignalDef& each : message.signals) names.push_back(each.name);
    errors.add(text->signal_line, key,
               "signal " + in_quotes(signal_name) + " that " + message.name + " does not have",
               "a signal of " + message.name + " in " + found->file->path +
                   nearest_hint(signal_name, names));
    return {};
  }

  RoleBinding binding;
  binding.role = role;
  binding.message_name = message.name;
  binding.signal_name = signal->name;
  binding.id = message.id;
  binding.sources = sources_of(message);
  binding.message_length = message.length;
  binding.message_fd = message.fd;
  binding.codec = can::SignalCodec(*signal);
  if (!binding.codec.fits(message.length)) {
    errors.add(text->signal_line, key,
               "signal " + in_quotes(signal_name) + " that lies outside the " +
                   std::to_string(message.length) + " bytes of " + message.name,
               "a signal inside its message");
    return {};
  }
  const std::uint32_t longest = message.fd ? can::kMaxPayload : kClassicPayload;
  if (message.length > longest) {
    errors.add(text->signal_line, key,
               "message " + in_quotes(message.name) + " of " + std::to_string(message.length) +
                   " bytes in " + found->file->path,
               "one that fits in a frame: at most 8 bytes, or 64 where the DBC marks it as CAN FD");
    return {};
  }
  if (!std::isfinite(signal->scale) || signal->scale == 0.0 || !std::isfinite(signal->offset)) {
    errors.add(text->signal_line, key,
               "signal " + in_quotes(signal_name) + " with factor 0 or none",
               "a finite factor other than 0 in " + found->file->path);
    return {};
  }
  const can::SignalDef* multiplexed = signal;
  for (std::size_t depth = 0; multiplexed->multiplexed_by; ++depth) {
    const can::MuxRule& rule = *multiplexed->multiplexed_by;
    const can::SignalDef* selector = message.find_signal(rule.selector);
    if (selector == nullptr || depth == kMuxDepth ||
        !can::SignalCodec(*selector).fits(message.length)) {
      errors.add(text->signal_line, key,
                 "signal " + in_quotes(signal_name) + " whose multiplexer " +
                     in_quotes(rule.selector) + " cannot be decoded",
                 "a multiplexer signal inside " + message.name);
      return {};
    }
    binding.mux.push_back({can::SignalCodec(*selector), rule.ranges});
    multiplexed = selector;
  }
  if (signal->minimum < signal->maximum) {
    binding.minimum = signal->minimum;
    binding.maximum = signal->maximum;
  }
  const std::optional<can::Unit> unit =
      role_unit(role, key, *text, *signal, found->file->path, errors);
  if (!unit) return {};
  if (text->true_when &&
      !read_true_when(role, key, *text->true_when, *signal, binding.true_when, errors)) {
    return {};
  }
  binding.unit = text->has_unit ? text->unit : signal->unit;
  binding.scale = text->scale;
  binding.offset = text->offset;
  binding.factor = unit->factor * text->scale;
  binding.shift = unit->factor * text->offset + unit->offset;
  binding.period_ms = text->period_ms;
  binding.delay_ms = text->delay_ms;
  // A multiplexed signal comes less often than its message: its own frames tell how often.
  if (!binding.period_ms && binding.mux.empty() && message.cycle_ms && *message.cycle_ms > 0.0) {
    binding.period_ms = message.cycle_ms;
  }
  if (!check_flag(key, *text, binding, *signal, errors)) return {};
  return binding;
}

std::optional<MessageProtection> SignalCatalogue::protect(const TomlNode& node,
                                                          ConfigErrors& errors) const {
  const std::string key = "protection." + node.key;
  if (node.type != TomlType::kTable) {
    errors.add(node.line, key, node.found(), "{ counter = \"Signal\", ... }");
    return {};
  }
  const std::optional<Found> found = find_message(node.key, key, node.line, errors);
  if (!found) return {};
  const can::MessageDef& message = *found->message;
  bool good = true;
  const auto wrong = [&](std::uint32_t line, const std::string& child, const std::string& what,
                         const std::string& expected) {
    errors.add(line, child.empty() ? key : key + "." + child, what, expected);
    good = false;
  };
  static const std::vector<std::string> kKeys{"counter", "counter_max", "crc", "data_id"};
  for (const TomlNode& child : node.children) {
    if (std::find(kKeys.begin(), kKeys.end(), child.key) == kKeys.end()) {
      wrong(child.line, child.key, "an unknown key",
            "counter, counter_max, crc or data_id" + nearest_hint(child.key, kKeys));
    }
  }
  // A plain unsigned signal of the message, or null with an error.
  const auto signal_of = [&](const TomlNode& child) -> const can::SignalDef* {
    const can::SignalDef* signal =
        child.type == TomlType::kText ? message.find_signal(child.text) : nullptr;
    constexpr std::uint32_t kLongest = 8;
    if (signal == nullptr || signal->type != can::ValueType::kUnsigned || signal->multiplexed_by ||
        signal->length > kLongest || !can::SignalCodec(*signal).fits(message.length)) {
      wrong(child.line, child.key, child.found(),
            "an unsigned signal of " + message.name + " of up to 8 bits, not multiplexed");
      return nullptr;
    }
    return signal;
  };
  const auto integer_of = [&](const TomlNode& child, std::int64_t low, std::int64_t high) {
    const bool in_range =
        child.type == TomlType::kInteger && child.integer >= low && child.integer <= high;
    if (!in_range) {
      wrong(child.line, child.key, child.found(),
            "an integer from " + std::to_string(low) + " to " + std::to_string(high));
    }
    return in_range ? static_cast<std::uint32_t>(child.integer) : 0U;
  };
  MessageProtection out;
  out.id = message.id;
  const TomlNode* counter = node.find("counter");
  const TomlNode* counter_max = node.find("counter_max");
  const TomlNode* crc = node.find("crc");
  const TomlNode* data_id = node.find("data_id");
  if (message.j1939) {
    wrong(node.line, "", "a message of a J1939 group", "one with an identifier of its own");
  }
  if (counter == nullptr && crc == nullptr) {
    wrong(node.line, "", "neither counter nor crc", "one of them");
  }
  if (counter == nullptr && counter_max != nullptr) {
    wrong(counter_max->line, "counter_max", "no counter", "counter = \"Signal\"");
  }
  if ((crc == nullptr) != (data_id == nullptr)) {
    wrong((crc != nullptr ? crc : data_id)->line, "", crc != nullptr ? "no data_id" : "no crc",
          "crc = \"Signal\" and data_id = 0x123");
  }
  if (const can::SignalDef* signal = counter == nullptr ? nullptr : signal_of(*counter)) {
    out.counter.emplace();
    out.counter->codec = can::SignalCodec(*signal);
    out.counter->maximum = static_cast<std::uint32_t>(out.counter->codec.mask());
    if (counter_max != nullptr) {
      out.counter->maximum = integer_of(*counter_max, 1, out.counter->maximum);
    }
  }
  if (const can::SignalDef* signal = crc == nullptr ? nullptr : signal_of(*crc)) {
    constexpr std::uint32_t kByte = 8;
    const std::uint32_t first = signal->byte_order == can::ByteOrder::kLittle ? 0 : kByte - 1;
    if (signal->length != kByte || signal->start_bit % kByte != first) {
      wrong(crc->line, "crc", crc->found(), "a signal that is one byte of the frame");
    }
    out.crc = CrcProtection{signal->start_bit / kByte, 0};
    if (data_id != nullptr) {
      out.crc->data_id = static_cast<std::uint16_t>(integer_of(*data_id, 0, 0xFFFF));
    }
  }
  return good ? std::optional(out) : std::nullopt;
}

}  // namespace beltgrip::daemon
