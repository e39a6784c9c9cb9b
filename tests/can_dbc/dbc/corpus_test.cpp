// The DBC files of public projects in the folder that BELTGRIP_CORPUS names: each loads whole, and
// everything that two other decoders agree on about it (expected/*.tsv.gz) is equal: messages,
// signals, value texts, and the raw and physical values of 20 payloads a message.
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <sstream>

#include "can_dbc/dbc/message_codec.h"
#include "can_dbc/dbc/parser.h"
#include "can_dbc/log/can_log.h"

namespace beltgrip::can {
namespace {

namespace fs = std::filesystem;
using Fields = std::vector<std::string>;

std::string read_file(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::vector<Fields> read_expected(const fs::path& path) {
  gzFile file = gzopen(path.c_str(), "rb");
  if (file == nullptr) throw std::runtime_error("cannot open " + path.string());
  std::string text;
  std::array<char, 65536> block;
  for (int n = 0; (n = gzread(file, block.data(), block.size())) > 0;) {
    text.append(block.data(), static_cast<std::size_t>(n));
  }
  gzclose(file);
  std::vector<Fields> lines;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    Fields fields;
    for (std::size_t field = at; field <= end;) {
      const std::size_t tab = std::min(text.find('\t', field), end);
      fields.push_back(text.substr(field, tab - field));
      field = tab + 1;
    }
    lines.push_back(std::move(fields));
    at = end + 1;
  }
  return lines;
}

double number(const std::string& text) {
  if (text == "nan") return std::nan("");
  double value = 0.0;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  EXPECT_EQ(status, std::errc{}) << text;
  EXPECT_EQ(end, text.data() + text.size()) << text;
  return value;
}

bool same(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }

struct Counts {
  std::size_t files = 0, messages = 0, signals = 0, texts = 0, payloads = 0, values = 0;
};

std::string multiplexing(const SignalDef& signal) {
  if (!signal.multiplexed_by) return signal.is_multiplexer ? "M" : "-";
  std::vector<ValueRange> ranges(signal.multiplexed_by->ranges.begin(),
                                 signal.multiplexed_by->ranges.end());
  std::sort(ranges.begin(), ranges.end());
  std::vector<std::pair<std::uint64_t, std::uint64_t>> joined;
  for (const auto& range : ranges) {
    if (!joined.empty() && range.first <= joined.back().second + 1) {
      joined.back().second = std::max(joined.back().second, range.second);
    } else {
      joined.push_back(range);
    }
  }
  std::string values;
  for (const auto& [low, high] : joined) {
    if (!values.empty()) values += ',';
    values += std::to_string(low);
    if (high != low) values += '-' + std::to_string(high);
  }
  return (signal.is_multiplexer ? "mM:" : "m:") + signal.multiplexed_by->selector + ':' + values;
}

// Walks the expected lines of one file beside the database.
class FileCheck {
 public:
  FileCheck(const Database& database, Counts& counts) : database_(database), counts_(counts) {}

  void line(const Fields& f) {
    switch (f[0][0]) {
      case 'F':
        loaded_by_reference_ = f[5] == "-";
        break;
      case 'M':
        finish_payload();
        message(f);
        break;
      case 'S':
        signal(f);
        break;
      case 'C':
        text(f);
        break;
      case 'V':
        finish_payload();
        payload(f);
        break;
      case 'R':
        value(f);
        break;
      default:
        break;
    }
  }

  void finish() {
    finish_payload();
    if (loaded_by_reference_) {
      EXPECT_EQ(messages_seen_, database_.messages.size());
    } else {
      EXPECT_FALSE(database_.messages.empty());
    }
  }

 private:
  void message(const Fields& f) {
    ++counts_.messages;
    const CanId id{static_cast<std::uint32_t>(std::stoul(f[1], nullptr, 16)), f[2] == "1"};
    message_ = nullptr;
    for (const MessageDef& candidate : database_.messages) {
      if (candidate.id == id && candidate.name == f[6] && !used_.contains(&candidate)) {
        message_ = &candidate;
        break;
      }
    }
    ASSERT_NE(message_, nullptr) << f[1] << ' ' << f[6];
    used_[message_] = true;
    ++messages_seen_;
    codec_ = MessageCodec(*message_);
    decoded_ = DecodedMessage(codec_.signal_count());
    signal_ = nullptr;
    texts_.clear();
    EXPECT_EQ(message_->length, std::stoul(f[3])) << f[6];
    EXPECT_EQ(message_->fd, f[4] == "1") << f[6];
    EXPECT_EQ(message_->cycle_ms ? *message_->cycle_ms : 0.0, f[5] == "-" ? 0.0 : number(f[5]))
        << f[6];
    signal_names_.clear();
  }

  // The occurrence of this name that has not been looked at, for files with a name twice.
  const SignalDef* find(const std::string& name, std::map<std::string, std::size_t>& seen) {
    std::size_t skip = seen[name]++;
    for (const SignalDef& candidate : message_->signals) {
      if (candidate.name == name && skip-- == 0) return &candidate;
    }
    return nullptr;
  }

  void signal(const Fields& f) {
    if (message_ == nullptr) return;
    ++counts_.signals;
    signal_ = find(f[1], signal_names_);
    ASSERT_NE(signal_, nullptr) << message_->name << '.' << f[1];
    const std::string where = message_->name + '.' + f[1];
    EXPECT_EQ(signal_->start_bit, std::stoul(f[2])) << where;
    EXPECT_EQ(signal_->length, std::stoul(f[3])) << where;
    EXPECT_EQ(signal_->byte_order == ByteOrder::kBig, f[4] == "B") << where;
    const char* const kinds[] = {"u", "s", "f", "d"};
    EXPECT_EQ(kinds[static_cast<int>(signal_->type)], f[5]) << where;
    EXPECT_EQ(signal_->scale, number(f[6])) << where;
    EXPECT_EQ(signal_->offset, number(f[7])) << where;
    EXPECT_EQ(signal_->usage->minimum, f[8] == "-" ? 0.0 : number(f[8])) << where;
    EXPECT_EQ(signal_->usage->maximum, f[9] == "-" ? 0.0 : number(f[9])) << where;
    EXPECT_EQ(signal_->unit, f[10]) << where;
    // The reference names a selector by its short name.
    const std::string rule = multiplexing(*signal_);
    SignalDef by_short_name = *signal_;
    MuxRule short_rule;
    if (signal_->multiplexed_by != nullptr) {
      const SignalDef* selector = message_->find_signal(signal_->multiplexed_by->selector);
      if (selector != nullptr && !selector->short_name.empty()) {
        short_rule = {selector->short_name, signal_->multiplexed_by->ranges};
        by_short_name.multiplexed_by = &short_rule;
      }
    }
    EXPECT_TRUE(rule == f[11] || multiplexing(by_short_name) == f[11])
        << where << ": " << rule << " instead of " << f[11];
  }

  void text(const Fields& f) {
    if (message_ == nullptr) return;
    ++counts_.texts;
    const SignalDef* owner = message_->find_signal(f[1]);
    ASSERT_NE(owner, nullptr) << message_->name << '.' << f[1];
    const auto key = f[2][0] == '-' ? std::stoll(f[2]) : static_cast<long long>(std::stoull(f[2]));
    const auto entry = owner->values.find(key);
    ASSERT_NE(entry, owner->values.end()) << message_->name << '.' << f[1] << ' ' << f[2];
    EXPECT_EQ(entry->second, f.size() > 3 ? f[3] : "") << message_->name << '.' << f[1];
    texts_[owner] += 1;
  }

  void payload(const Fields& f) {
    if (message_ == nullptr) return;
    if (!texts_checked_.contains(message_)) {
      texts_checked_[message_] = true;
      for (const SignalDef& candidate : message_->signals) {
        if (&candidate != message_->find_signal(candidate.name)) continue;
        EXPECT_EQ(candidate.values.size(), texts_[&candidate])
            << message_->name << '.' << candidate.name;
      }
    }
    ++counts_.payloads;
    in_payload_ = true;
    payload_text_ = f[1];
    std::vector<std::uint8_t> bytes;
    for (std::size_t i = 0; i + 1 < f[1].size(); i += 2) {
      bytes.push_back(static_cast<std::uint8_t>(std::stoul(f[1].substr(i, 2), nullptr, 16)));
    }
    codec_.decode(bytes, decoded_);
    expected_present_ = 0;
    value_names_.clear();
  }

  void value(const Fields& f) {
    if (message_ == nullptr) return;
    ++counts_.values;
    ++expected_present_;
    const SignalDef* found = find(f[1], value_names_);
    const std::string where = message_->name + '.' + f[1] + " of " + payload_text_;
    ASSERT_NE(found, nullptr) << where;
    const auto index = static_cast<std::size_t>(found - message_->signals.data());
    const DecodedSignal& got = decoded_[index];
    ASSERT_TRUE(decoded_.has(index)) << where;
    if (codec_.signal(index).is_float()) {
      EXPECT_TRUE(same(number(codec_.signal(index).raw_text(got.raw)), number(f[2]))) << where;
    } else {
      EXPECT_EQ(codec_.signal(index).raw_text(got.raw), f[2]) << where;
    }
    EXPECT_TRUE(same(got.physical, number(f[3])))
        << where << ": " << got.physical << " instead of " << f[3];
  }

  // Exactly the signals with an R line are present. The reference leaves out what is selected by a
  // signal with a long name, or by one that is not marked as a multiplexer; those may be more.
  void finish_payload() {
    if (!in_payload_) return;
    in_payload_ = false;
    std::size_t present = 0;
    for (std::size_t i = 0; i < message_->signals.size(); ++i) {
      const SignalDef& signal = message_->signals[i];
      const SignalDef* selector =
          signal.multiplexed_by ? message_->find_signal(signal.multiplexed_by->selector) : nullptr;
      const bool beyond_reference =
          selector != nullptr && (!selector->short_name.empty() || !selector->is_multiplexer);
      if (beyond_reference && !value_names_.contains(signal.name)) continue;
      if (decoded_.has(i)) ++present;
    }
    EXPECT_EQ(present, expected_present_) << message_->name << " of " << payload_text_;
  }

  const Database& database_;
  Counts& counts_;
  const MessageDef* message_ = nullptr;
  const SignalDef* signal_ = nullptr;
  std::map<const MessageDef*, bool> used_;
  std::map<const MessageDef*, bool> texts_checked_;
  std::map<const SignalDef*, std::size_t> texts_;
  std::map<std::string, std::size_t> signal_names_;
  std::map<std::string, std::size_t> value_names_;
  std::size_t messages_seen_ = 0;
  MessageCodec codec_;
  DecodedMessage decoded_;
  std::string payload_text_;
  bool in_payload_ = false;
  bool loaded_by_reference_ = true;
  std::size_t expected_present_ = 0;
};

TEST(Corpus, EveryFileLoadsWholeAndEveryValueIsEqual) {
  const char* folder = std::getenv("BELTGRIP_CORPUS");
  if (folder == nullptr) {
    GTEST_SKIP() << "BELTGRIP_CORPUS is not set: no DBC file of the corpus was checked";
  }
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(fs::path(folder) / "dbc")) {
    files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  ASSERT_FALSE(files.empty());

  Counts counts;
  std::map<std::string, std::size_t> warnings;
  for (const fs::path& file : files) {
    SCOPED_TRACE(file.filename().string());
    const DbcParseResult result = parse_dbc(read_file(file));
    for (const Problem& problem : result.problems) {
      ++warnings[problem.code];
      EXPECT_TRUE(problem.severity == Severity::kWarning || problem.code == "no-message")
          << problem.line << ':' << problem.column << ' ' << problem.text;
    }
    FileCheck check(result.database, counts);
    const fs::path expected =
        fs::path(folder) / "expected" / file.filename().replace_extension(".tsv.gz");
    for (const Fields& fields : read_expected(expected)) check.line(fields);
    check.finish();
    ++counts.files;
  }
  std::cout << counts.files << " files, " << counts.messages << " messages, " << counts.signals
            << " signals, " << counts.texts << " value texts, " << counts.payloads << " payloads, "
            << counts.values << " values\n";
  for (const auto& [code, count] : warnings) std::cout << "  " << code << ' ' << count << '\n';
  EXPECT_GT(counts.values, 0U);
}

TEST(Corpus, EveryLogIsReadWithoutABadLine) {
  const char* folder = std::getenv("BELTGRIP_CORPUS");
  if (folder == nullptr) GTEST_SKIP() << "BELTGRIP_CORPUS is not set: no log was checked";
  std::size_t logs = 0;
  std::uint64_t frames = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(folder) / "logs")) {
    SCOPED_TRACE(entry.path().filename().string());
    const auto reader = LogReader::open(entry.path().string());
    LogRecord record;
    while (reader->next(record)) {
    }
    const LogStats& stats = reader->stats();
    EXPECT_GT(stats.frames, 0U);
    EXPECT_EQ(stats.lines_bad, 0U);
    ++logs;
    frames += stats.frames;
  }
  std::cout << logs << " logs, " << frames << " frames\n";
  EXPECT_GT(logs, 0U);
}

}  // namespace
}  // namespace beltgrip::can
