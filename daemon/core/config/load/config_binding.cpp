#include <array>
#include <cmath>

#include "daemon/core/config/load/config_flag.h"
#include "daemon/core/config/load/signal_catalogue.h"
#include "daemon/core/config/options/config_role.h"

namespace beltgrip::daemon {

namespace {

// Chosen: ends a circle of multiplexers. DBC files nest two or three.
constexpr std::size_t kMuxDepth = 16;
// Values at which a flag is 1. Derived: all of a signal of 8 bits.
constexpr std::size_t kNamedMost = 256;
constexpr std::uint32_t kClassicPayload = 8;
constexpr const char* kUnitOfSignal = "unit in { signal = \"...\", unit = \"...\" }";

std::string signal_text(const can::SignalDef& signal) {
  return std::to_string(signal.start_bit) + "|" + std::to_string(signal.length) +
         (signal.byte_order == can::ByteOrder::kBig ? "@0" : "@1") +
         (signal.type == can::ValueType::kSigned ? "-" : "+");
}

// From what the file says of a role and the signal that it names to the binding. What is wrong is
// added to the errors; then there is no binding.
class RoleBinder {
 public:
  // unit_hint: where a unit that is wrong can be set.
  RoleBinder(Role role, const TomlNode& node, const RoleText& text, ConfigErrors& errors,
             std::string unit_hint)
      : role_(role),
        key_(key_of("signals", role_name(role))),
        node_(node),
        text_(text),
        errors_(errors),
        unit_hint_(std::move(unit_hint)) {}

  std::optional<RoleBinding> from_diagnostics(const UdsSource& source) const;
  // `binding` knows its message already.
  std::optional<RoleBinding> from_message(RoleBinding binding, const can::MessageDef& message,
                                          const can::SignalDef& signal,
                                          const std::string& dbc_path) const;

 private:
  bool can_be_decoded(const can::MessageDef& message, const can::SignalDef& signal,
                      const std::string& dbc_path) const;
  bool read_multiplexers(const can::MessageDef& message, const can::SignalDef& signal,
                         RoleBinding& binding) const;
  bool read_true_when(const can::SignalDef& signal, RoleBinding& binding) const;
  bool check_flag(const RoleBinding& binding, const can::SignalDef& signal) const;
  std::optional<can::Unit> unit_of(const can::SignalDef& signal, const std::string& dbc_path) const;

  bool is_given(std::string_view key) const {
    return node_.type == TomlType::kTable && node_.find(key) != nullptr;
  }
  const TomlNode* true_when() const {
    return is_given("true_when") ? node_.find("true_when") : nullptr;
  }
  std::uint32_t signal_line() const { return line_in_role(node_, "signal"); }

  Role role_;
  std::string key_;
  const TomlNode& node_;
  const RoleText& text_;
  ConfigErrors& errors_;
  std::string unit_hint_;
};

// The raw values at which a flag is 1: texts or numbers of the signal's value table. False when
// errors were added.
bool RoleBinder::read_true_when(const can::SignalDef& signal, RoleBinding& binding) const {
  const TomlNode* const given = true_when();
  if (given == nullptr) return true;
  const TomlNode& node = *given;
  std::vector<std::int64_t>& values = binding.true_when;
  std::vector<std::string> labels;
  for (const auto& [number, label] : signal.values) labels.push_back(label);
  const std::string where = key_of(key_, "true_when");
  const auto wrong = [&](const TomlNode& child, const std::string& expected) {
    errors_.add(child.line, where, child.found(), expected);
    return false;
  };
  if (role_dimension(role_) != can::Dimension::kNone) {
    return wrong(node, "no such key: " + std::string(role_name(role_)) + " is no flag");
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
  if (values.size() > kNamedMost)
    return wrong(node, "at most " + std::to_string(kNamedMost) + " values");
  return true;
}

// A flag that never changes is no flag. False when errors were added.
bool RoleBinder::check_flag(const RoleBinding& binding, const can::SignalDef& signal) const {
  if (role_dimension(binding.role) != can::Dimension::kNone) return true;
  const FlagValues values = flag_values(binding, signal);
  if (values.zero && values.one) return true;
  const std::string never = std::string("a flag that is never ") + (values.zero ? "1" : "0");
  if (const TomlNode* given = true_when()) {
    errors_.add(given->line, key_of(key_, "true_when"), never, "some of the signal's raw values");
  } else {
    errors_.add(signal_line(), key_, never,
                "a signal, or a scale and an offset for it, that is 0 and 1 at raw values of its "
                "range; or true_when");
  }
  return false;
}

// The unit of a role; nothing when errors were added.
std::optional<can::Unit> RoleBinder::unit_of(const can::SignalDef& signal,
                                             const std::string& dbc_path) const {
  const can::Dimension dimension = role_dimension(role_);
  const bool has_unit = is_given("unit");
  const std::uint32_t line = line_in_role(node_, "unit");
  const std::string& unit_text = has_unit ? text_.unit : signal.unit;
  if (dimension == can::Dimension::kShare && unit_text == can::si_unit_text(dimension)) {
    return can::Unit{dimension};
  }
  const std::optional<can::Unit> unit = can::parse_unit(unit_text);
  const std::string where = has_unit || dbc_path.empty() ? "" : " in " + dbc_path;
  const std::string found =
      unit_text.empty() ? "no unit" + where : "unit " + in_quotes(unit_text) + where;
  if (dimension == can::Dimension::kNone) {
    if (unit && unit->dimension != can::Dimension::kNone) {
      errors_.add(line, key_,
                  found + " (" + std::string(can::dimension_name(unit->dimension)) + ")",
                  "a signal without unit, 0 or 1");
      return {};
    }
    return can::Unit{};
  }
  const std::string wanted = "a unit of " + std::string(can::dimension_name(dimension)) +
                             " such as " + std::string(can::si_unit_text(dimension));
  const std::string hint = has_unit ? "" : "; set " + unit_hint_;
  if (!unit || unit->dimension == can::Dimension::kNone) {
    errors_.add(line, key_, found, wanted + hint);
    return {};
  }
  if (unit->dimension != dimension) {
    errors_.add(line, key_, found + " (" + std::string(can::dimension_name(unit->dimension)) + ")",
                wanted + hint);
    return {};
  }
  return unit;
}

std::optional<RoleBinding> RoleBinder::from_diagnostics(const UdsSource& source) const {
  const can::SignalDef& signal = source.signal;
  const std::optional<can::Unit> unit = unit_of(signal, "");
  if (!unit) return {};
  RoleBinding binding;
  binding.role = role_;
  binding.uds = source;
  binding.id = source.response;
  binding.message_name = id_text(source.response);
  binding.signal_name = (source.service == can::kReadByIdentifier ? "did " : "local id ") +
                        id_text({source.identifier, false}) + " " + signal_text(signal);
  binding.codec = can::SignalCodec(signal);
  if (!read_true_when(signal, binding)) return {};
  binding.unit = text_.unit;
  binding.factor = unit->factor;
  binding.shift = unit->offset;
  binding.period_ms = text_.period_ms;
  binding.delay_ms = text_.delay_ms;
  if (!check_flag(binding, signal)) return {};
  return binding;
}

bool RoleBinder::can_be_decoded(const can::MessageDef& message, const can::SignalDef& signal,
                                const std::string& dbc_path) const {
  if (!can::SignalCodec(signal).fits(message.length)) {
    errors_.add(signal_line(), key_,
                "signal " + in_quotes(signal.name) + " that lies outside the " +
                    std::to_string(message.length) + " bytes of " + message.name,
                "a signal inside its message");
    return false;
  }
  const std::uint32_t longest = message.fd ? can::kMaxPayload : kClassicPayload;
  if (message.length > longest) {
    errors_.add(
        signal_line(), key_,
        "message " + in_quotes(message.name) + " of " + std::to_string(message.length) +
            " bytes in " + dbc_path,
        "one that fits in a frame: at most 8 bytes, or 64 where the DBC marks it as CAN FD");
    return false;
  }
  if (!std::isfinite(signal.scale) || signal.scale == 0.0 || !std::isfinite(signal.offset)) {
    errors_.add(signal_line(), key_, "signal " + in_quotes(signal.name) + " with factor 0 or none",
                "a finite factor other than 0 in " + dbc_path);
    return false;
  }
  return true;
}

// Selectors from the signal upwards.
bool RoleBinder::read_multiplexers(const can::MessageDef& message, const can::SignalDef& signal,
                                   RoleBinding& binding) const {
  const can::SignalDef* multiplexed = &signal;
  for (std::size_t depth = 0; multiplexed->multiplexed_by; ++depth) {
    const can::MuxRule& rule = *multiplexed->multiplexed_by;
    const can::SignalDef* selector = message.find_signal(rule.selector);
    if (selector == nullptr || depth == kMuxDepth ||
        !can::SignalCodec(*selector).fits(message.length)) {
      errors_.add(signal_line(), key_,
                  "signal " + in_quotes(signal.name) + " whose multiplexer " +
                      in_quotes(rule.selector) + " cannot be decoded",
                  "a multiplexer signal inside " + message.name);
      return false;
    }
    binding.mux.push_back({can::SignalCodec(*selector), {rule.ranges.begin(), rule.ranges.end()}});
    multiplexed = selector;
  }
  return true;
}

std::optional<RoleBinding> RoleBinder::from_message(RoleBinding binding,
                                                    const can::MessageDef& message,
                                                    const can::SignalDef& signal,
                                                    const std::string& dbc_path) const {
  if (!can_be_decoded(message, signal, dbc_path)) return {};
  binding.signal_name = signal.name;
  binding.codec = can::SignalCodec(signal);
  if (!read_multiplexers(message, signal, binding)) return {};
  if (signal.usage->minimum < signal.usage->maximum) {
    binding.minimum = signal.usage->minimum;
    binding.maximum = signal.usage->maximum;
  }
  const std::optional<can::Unit> unit = unit_of(signal, dbc_path);
  if (!unit) return {};
  if (!read_true_when(signal, binding)) return {};
  binding.unit = is_given("unit") ? text_.unit : signal.unit;
  binding.scale = text_.scale;
  binding.offset = text_.offset;
  binding.factor = unit->factor * text_.scale;
  binding.shift = unit->factor * text_.offset + unit->offset;
  binding.period_ms = text_.period_ms;
  binding.delay_ms = text_.delay_ms;
  // A multiplexed signal comes less often than its message: its own frames tell how often.
  if (!binding.period_ms && binding.mux.empty() && message.cycle_ms && *message.cycle_ms > 0.0) {
    binding.period_ms = message.cycle_ms;
  }
  if (!check_flag(binding, signal)) return {};
  return binding;
}

}  // namespace

std::optional<RoleBinding> SignalCatalogue::bind(Role role, const TomlNode& node,
                                                 ConfigErrors& errors) const {
  const std::string key = key_of("signals", role_name(role));
  const std::optional<RoleText> text = read_role(key, node, errors);
  if (!text) return {};
  const RoleBinder binder(role, node, *text, errors,
                          text->uds ? "unit in { uds = { ... }, unit = \"...\" }" : kUnitOfSignal);
  if (!text->uds && text->signal.empty()) {
    errors.add(line_in_role(node, "column"), key, "a column, which no bus has",
               "signal = \"Message.Signal\" beside it; check, calibrate and replay of a table do "
               "without");
    return {};
  }
  if (text->uds) return binder.from_diagnostics(*text->uds);
  const std::uint32_t line = line_in_role(node, "signal");
  const std::size_t dot = text->signal.find('.');
  if (dot == std::string::npos || dot == 0 || dot + 1 == text->signal.size()) {
    errors.add(line, key, in_quotes(text->signal),
               "\"Message.Signal\", \"0x123.Signal\" or \"0x12345678x.Signal\"");
    return {};
  }
  const std::optional<Found> found =
      find_message(std::string_view(text->signal).substr(0, dot), key, line, errors);
  if (!found) return {};
  const can::MessageDef& message = *found->message;
  const std::string signal_name = text->signal.substr(dot + 1);
  const can::SignalDef* signal = message.find_signal(signal_name);
  if (signal == nullptr) {
    std::vector<std::string> names;
    names.reserve(message.signals.size());
    for (const can::SignalDef& each : message.signals) names.push_back(each.name);
    errors.add(line, key,
               "signal " + in_quotes(signal_name) + " that " + message.name + " does not have",
               "a signal of " + message.name + " in " + found->file->path +
                   nearest_hint(signal_name, names));
    return {};
  }
  RoleBinding binding;
  binding.role = role;
  binding.message_name = message.name;
  binding.id = message.id;
  binding.sources = sources_of(message);
  binding.message_length = message.length;
  binding.message_fd = message.fd;
  return binder.from_message(std::move(binding), message, *signal, found->file->path);
}

std::optional<RoleBinding> SignalCatalogue::bind_column(Role role, const TomlNode* node,
                                                        const can::Database& columns,
                                                        ConfigErrors& errors) const {
  const std::string key = key_of("signals", role_name(role));
  RoleText text;
  if (node != nullptr) {
    const std::optional<RoleText> given = read_role(key, *node, errors);
    if (!given) return {};
    text = *given;
  }
  const std::string signal_name = text.signal.substr(text.signal.find('.') + 1);
  const can::MessageDef* message = nullptr;
  bool as_role = false;
  if (!text.column.empty()) {
    message = columns.find_message(text.column);
  } else {
    message = columns.find_message(std::string(role_name(role)));
    as_role = message != nullptr;  // SI or by its own unit: what the signal's needs is not for it
    if (message == nullptr) message = columns.find_message(text.signal);
    if (message == nullptr) message = columns.find_message(signal_name);
  }
  RoleBinding binding;
  binding.role = role;
  binding.message_length = kClassicPayload;
  if (message == nullptr) {
    if (node == nullptr) return {};
    binding.signal_name = text.column.empty() ? signal_name : text.column;
    binding.id = {can::kExtendedIdMax, true};
    return binding;
  }
  can::SignalDef signal = message->signals.front();
  const can::SignalDef* known = as_role ? nullptr : find_signal(text.signal);
  if (known != nullptr) {
    if (signal.unit.empty()) signal.unit = known->unit;
    const bool plain = known->scale == 1.0 && known->offset == 0.0;
    if (signal.values.empty() && plain) signal.values = known->values;
  }
  binding.message_name = message->name;
  binding.id = message->id;
  const std::string unit_hint =
      as_role ? "it in the header, as in " + std::string(role_name(role)) + "[" +
                    std::string(can::si_unit_text(role_dimension(role))) + "]"
      : text.column.empty() ? kUnitOfSignal
                            : "unit in { column = \"...\", unit = \"...\" }";
  TomlNode bare;  // its place alone
  if (node != nullptr) bare.line = node->line;
  const TomlNode& of_signal = as_role || node == nullptr ? bare : *node;
  if (as_role) text = {};
  return RoleBinder(role, of_signal, text, errors, unit_hint)
      .from_message(std::move(binding), *message, signal, "the table");
}

}  // namespace beltgrip::daemon
