#include "tools/ports/record_port.h"

#include <algorithm>
#include <charconv>
#include <optional>

namespace beltgrip::ports {

using daemon::MonoTime;

namespace {

constexpr std::string_view kHeader = "beltgrip-record ";

std::vector<std::string_view> words_of(std::string_view text) {
  std::vector<std::string_view> words;
  while (!text.empty()) {
    const std::size_t length = std::min(text.find(' '), text.size());
    if (length > 0) words.push_back(text.substr(0, length));
    text.remove_prefix(std::min(length + 1, text.size()));
  }
  return words;
}

template <typename T>
T number(std::string_view text) {
  T value{};
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

// "(1700000000.123456789)", always nine digits.
std::optional<MonoTime> stamp(std::string_view text) {
  const std::size_t point = text.find('.');
  if (!text.starts_with('(') || !text.ends_with(')') || point == std::string_view::npos) return {};
  return MonoTime(number<std::int64_t>(text.substr(1, point - 1)) * daemon::kSecond) +
         daemon::Duration::of_ns(number<std::int64_t>(text.substr(point + 1, 9)));
}

}  // namespace

std::optional<int> RecordPort::version_of(const std::string& path) {
  const auto log = can::LogReader::open(path, true);
  can::LogRecord record;
  if (!log->next(record) || !record.note.starts_with(kHeader)) return {};
  return number<int>(std::string_view(record.note).substr(kHeader.size()));
}

RecordPort::RecordPort(const std::string& path, Receiver receiver, Learner learner)
    : log_(can::LogReader::open(path, true)),
      receiver_(std::move(receiver)),
      learner_(std::move(learner)) {
  const auto ahead = can::LogReader::open(path, true);
  for (can::LogRecord record; ahead->next(record);) {
    ended_ = record.note.find(" end ") != std::string_view::npos;
  }
  for (read(); has_next_ && !next_.is_frame && next_.word != "start"; read()) obey(next_);
  now_ = first_ = limit_ = next_.t;
}

void RecordPort::read() {
  can::LogRecord record;
  for (;;) {
    has_next_ = log_->next(record);
    if (!has_next_) return;
    next_ = {};
    if (record.note.empty()) {
      next_.is_frame = true;
      next_.t = MonoTime::of_ns(record.t_ns);
      next_.frame = record.frame;
      next_.sent = record.sent;
      next_.bus = !further_.empty() && record.interface == further_ ? 1 : 0;
      return;
    }
    const auto words = words_of(record.note);
    if (record.note.starts_with(kHeader) && words.size() > 3) further_ = words[3];
    const auto t = words.size() < 2 ? std::nullopt : stamp(words[0]);
    if (!t) continue;
    next_.t = *t;
    next_.word = words[1];
    next_.numbers.assign(words.begin() + 2, words.end());
    return;
  }
}

// "-", or mu_max, its lower end and the scatter; in version 1 mu_max alone.
RecordedKnowledge::Group RecordPort::group_of(std::string_view text) {
  RecordedKnowledge::Group group;
  if (text == "-") return group;
  const std::size_t first = std::min(text.find('/'), text.size());
  group.low = group.mu_max = number<double>(text.substr(0, first));
  const std::size_t second = text.find('/', first + 1);
  if (first == text.size() || second == std::string_view::npos) return group;
  group.low = number<double>(text.substr(first + 1, second - first - 1));
  group.scatter_percent = number<double>(text.substr(second + 1));
  return group;
}

void RecordPort::obey(const Line& note) {
  const auto text = [&](std::size_t i) -> std::string_view {
    return i < note.numbers.size() ? std::string_view(note.numbers[i]) : std::string_view();
  };
  if (note.word == "late") late_ = MonoTime::of_ns(number<std::int64_t>(text(0)));
  if (note.word == "bus" && number<unsigned>(text(0)) < states_.size()) {
    states_[number<unsigned>(text(0))] = static_cast<daemon::BusState>(number<unsigned>(text(1)));
  }
  if (note.word == "lost") lost_ += number<std::uint32_t>(text(0));
  if (note.word == "failed") {
    failed_.push_back({number<unsigned>(text(0)), number<std::uint32_t>(text(1)),
                       static_cast<daemon::SendResult>(number<unsigned>(text(2)))});
  }
  if (note.word == "memory") {
    memory_.clear();
    for (const std::string& each : note.numbers) memory_.push_back(number<double>(each));
  }
  if (note.word == "learned" && learner_) {
    RecordedKnowledge known{text(0) == "1", text(1) == "1", {}, memory_};
    for (std::size_t i = 0; i < known.groups.size(); ++i) known.groups[i] = group_of(text(2 + i));
    learner_(known);
  }
  if (note.word == "end") {
    closed_ = true;
    now_ = MonoTime::of_ns(number<std::int64_t>(text(0)));
  }
}

daemon::Wake RecordPort::wait_until(MonoTime deadline) noexcept {
  late_ = {};
  failed_.clear();
  while (!closed_ && has_next_ && next_.t <= deadline) {
    if (next_.is_frame) {
      now_ = std::max(now_, next_.t);
      limit_ = deadline;
      return daemon::Wake::kFrames;
    }
    obey(next_);
    read();
  }
  // What the last frames met with.
  for (; closed_ && has_next_; read()) obey(next_);
  if (closed_ || !has_next_) return daemon::Wake::kClosed;
  now_ = std::max({now_, deadline, late_});
  return daemon::Wake::kDeadline;
}

std::size_t RecordPort::receive(std::span<daemon::RxFrame> out) noexcept {
  std::size_t count = 0;
  while (count < out.size() && has_next_ && next_.is_frame && next_.t <= limit_) {
    out[count++] = {next_.t, next_.frame, next_.sent, lost_, next_.bus};
    lost_ = 0;
    now_ = std::max(now_, next_.t);
    read();
  }
  return count;
}

// As in a log: what the daemon sent meanwhile is wanted where there is a receiver.
MonoTime RecordPort::silent_until() noexcept {
  return receiver_ || !has_next_ ? Port::silent_until() : next_.t;
}

daemon::SendResult RecordPort::send_on(std::uint8_t bus, const can::CanFrame& frame) noexcept {
  for (const Failure& each : failed_) {
    if (each.bus == bus && each.id == frame.id.value) return each.result;
  }
  if (receiver_) receiver_(now_, frame, bus);
  return daemon::SendResult::kSent;
}

}  // namespace beltgrip::ports
