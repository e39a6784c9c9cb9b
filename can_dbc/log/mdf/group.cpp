#include "can_dbc/log/mdf/group.h"

#include <algorithm>

namespace beltgrip::can::mdf {

namespace {

constexpr std::size_t kGroupsMost = 4096;   // of a data group; bus loggers have a hundred
constexpr std::size_t kWaitingMost = 4096;  // frames, or payloads, that wait for their other half
constexpr std::size_t kGroupFields = 32;
constexpr std::size_t kPayloadMost = 64 + 1;
constexpr std::uint16_t kVariableFlag = 1;

bool fill(CanFrame& frame, std::size_t length, std::string_view payload) {
  if (payload.size() < length) return false;
  std::copy_n(payload.begin(), length, frame.data.begin());
  return true;
}

}  // namespace

DataGroup::DataGroup(File& file, const Block& group, bool finished, std::int64_t start_ns)
    : start_ns_(start_ns) {
  const std::string fields = file.data(group, 1);
  if (group.id != "##DG" || group.links.size() < 4 || fields.empty()) {
    throw MdfError{group.at, "a block " + group.id + ", expected a data group (DG)"};
  }
  identifier_bytes_ = Fields(fields).u8(0);
  if (identifier_bytes_ > 8 || (identifier_bytes_ & (identifier_bytes_ - 1)) != 0) {
    throw MdfError{group.at, "record identifiers of " + std::to_string(identifier_bytes_) +
                                 " bytes, expected 0, 1, 2, 4 or 8"};
  }
  std::uint64_t link = group.links[1];
  while (link != 0) {
    const Block block = file.block(link);
    add_group(file, block, finished);
    link = block.links[0];
  }
  auto source = std::make_unique<DataSource>(file, has_frames_ ? group.links[2] : 0, !finished);
  source_ = source.get();
  records_ = std::make_unique<BinaryInput>(std::move(source));
}

void DataGroup::add_group(File& file, const Block& block, bool finished) {
  const std::string bytes = file.data(block, kGroupFields);
  if (block.id != "##CG" || block.links.size() < 6 || bytes.size() < kGroupFields) {
    throw MdfError{block.at, "a block " + block.id + ", expected a channel group (CG)"};
  }
  if (groups_.size() == kGroupsMost) throw MdfError{block.at, "more than 4096 channel groups"};
  const Fields fields(bytes);
  ChannelGroup group;
  group.at = block.at;
  group.variable = (fields.u16(16) & kVariableFlag) != 0;
  const std::size_t data_bytes = fields.u32(24);
  const std::size_t validity_bytes = fields.u32(28);
  group.record_bytes = data_bytes + validity_bytes;
  if (!group.variable) group.layout = read_layout(file, block, data_bytes, validity_bytes);
  if (group.layout) {
    has_frames_ = true;
    if (group.record_bytes > BinaryInput::kTakeMost) {
      throw MdfError{block.at, "records of " + std::to_string(group.record_bytes) +
                                   " bytes, expected at most 65536"};
    }
    const std::uint64_t link = group.layout->payload_link;
    if (group.layout->payload_offset.there() && link != 0 && file.block(link).id != "##CG") {
      auto source = std::make_unique<DataSource>(file, link, !finished);
      group.payload_source = source.get();
      group.payloads = std::make_unique<BinaryInput>(std::move(source));
    }
  }
  const std::uint64_t identifier = fields.u64(0);
  identifier_of_[block.at] = identifier;
  if (!groups_.emplace(identifier, std::move(group)).second) {
    throw MdfError{block.at,
                   "a second channel group with the identifier " + std::to_string(identifier)};
  }
}

RecordKind DataGroup::bad(std::uint64_t byte, std::string reason) {
  byte_ = byte;
  reason_ = std::move(reason);
  return RecordKind::kBad;
}

const ReadyFrame* DataGroup::front() const {
  return !waiting_.empty() && waiting_.front().whole ? &waiting_.front().ready : nullptr;
}

RecordKind DataGroup::step() {
  if (front() != nullptr) return RecordKind::kFrame;
  if (!ended_) return step_record();
  if (waiting_.empty()) return RecordKind::kEnd;
  const std::uint64_t at = waiting_.front().byte;
  waiting_.pop_front();
  return bad(at, "a frame whose data bytes are not in the file");
}

// Nothing behind can be read.
RecordKind DataGroup::end() {
  ended_ = true;
  const std::uint64_t position = records_->position();
  if (!records_->fault().empty()) return bad(source_->place_of(UINT64_MAX), records_->fault());
  return records_->at_end()
             ? RecordKind::kNothing
             : bad(source_->place_of(position), "a record is cut off by the end of the data");
}

std::optional<std::uint64_t> DataGroup::next_identifier() {
  if (identifier_bytes_ == 0) {
    return records_->at_end() ? std::nullopt : std::optional(groups_.begin()->first);
  }
  const auto bytes = records_->take(identifier_bytes_);
  if (!bytes) return std::nullopt;
  std::uint64_t identifier = 0;
  for (std::size_t i = bytes->size(); i-- > 0;) {
    identifier = (identifier << 8U) | static_cast<unsigned char>((*bytes)[i]);
  }
  return identifier;
}

RecordKind DataGroup::step_record() {
  if (!has_frames_) {
    ended_ = true;
    return RecordKind::kNothing;
  }
  const std::uint64_t position = records_->position();
  const auto identifier = next_identifier();
  if (!identifier) return end();
  const auto found = groups_.find(*identifier);
  const std::uint64_t at = source_->place_of(position);
  if (found == groups_.end()) {
    ended_ = true;
    return bad(at, "a record of group " + std::to_string(*identifier) +
                       ", which the file does not describe: damaged from here on");
  }
  ChannelGroup& group = found->second;
  if (group.variable) return take_variable(group, at);
  if (!group.layout) {
    if (group.record_bytes == 0 && identifier_bytes_ == 0) {
      ended_ = true;
      return RecordKind::kNothing;
    }
    return records_->skip(group.record_bytes) ? RecordKind::kNothing : end();
  }
  const auto record = records_->take(group.record_bytes);
  if (!record) return end();
  return take_frame(group, *group.layout, *record, at);
}

// A length and so many bytes: the payload of a frame, mostly of the one before.
RecordKind DataGroup::take_variable(ChannelGroup& group, std::uint64_t at) {
  constexpr std::uint64_t kLengthBytes = 4;
  const auto head = records_->take(kLengthBytes);
  if (!head) return end();
  const std::uint32_t size = Fields(*head).u32(0);
  const std::size_t kept = std::min<std::size_t>(size, kPayloadMost);
  const auto bytes = records_->take(kept);
  if (!bytes) return end();
  const std::uint64_t offset = group.streamed;
  group.streamed += kLengthBytes + size;
  const auto wanting = std::find_if(waiting_.begin(), waiting_.end(), [&](const Waiting& frame) {
    return !frame.whole && frame.group == group.at && frame.offset == offset;
  });
  RecordKind kind = RecordKind::kNothing;
  if (wanting == waiting_.end()) {
    group.values[offset] = *bytes;
    if (group.values.size() > kWaitingMost) group.values.erase(group.values.begin());
  } else if (fill(wanting->ready.frame, wanting->length, *bytes)) {
    wanting->whole = true;
  } else {
    waiting_.erase(wanting);
    kind = bad(at, "fewer data bytes than the frame's length says");
  }
  if (!records_->skip(size - kept)) return end();
  return kind;
}

RecordKind DataGroup::take_frame(ChannelGroup& group, const FrameLayout& layout,
                                 std::string_view record, std::uint64_t at) {
  Waiting frame;
  frame.byte = at;
  if (const char* wrong = read_frame(layout, record, frame.ready.frame, frame.length)) {
    return bad(at, wrong);
  }
  const auto t_ns = time_ns(layout.time, record, start_ns_);
  if (!t_ns) return bad(at, "time stamp beyond the range");
  frame.ready.t_ns = *t_ns;
  frame.ready.channel = layout.channel.there() ? layout.channel.integer(record) : 1;
  frame.ready.sent = layout.sent.there() && layout.sent.integer(record) != 0;
  if (layout.kind == EventKind::kData && layout.payload_offset.there() && frame.length > 0) {
    frame.offset = layout.payload_offset.integer(record);
    if (group.payloads != nullptr) {
      if (own_payload(group, frame) == RecordKind::kBad) return bad(at, reason_);
    } else {
      const auto identifier = identifier_of_.find(layout.payload_link);
      if (identifier == identifier_of_.end()) {
        return bad(at, "a frame whose data bytes are not in the file");
      }
      auto& values = groups_.at(identifier->second).values;
      const auto value = values.find(frame.offset);
      frame.group = layout.payload_link;
      frame.whole = value != values.end();
      if (frame.whole && !fill(frame.ready.frame, frame.length, value->second)) {
        return bad(at, "fewer data bytes than the frame's length says");
      }
      if (frame.whole) values.erase(value);
    }
  } else if (layout.kind == EventKind::kData &&
             !fill(frame.ready.frame, frame.length,
                   record.substr(layout.payload_at, layout.payload_size))) {
    return bad(at, "fewer data bytes than the frame's length says");
  }
  waiting_.push_back(frame);
  if (waiting_.size() <= kWaitingMost) return RecordKind::kNothing;
  const bool lost = !waiting_.front().whole;
  const std::uint64_t first = waiting_.front().byte;
  if (!lost) return RecordKind::kNothing;
  waiting_.pop_front();
  return bad(first, "a frame whose data bytes do not follow it");
}

// Payloads beside the records: in the order of the frames.
RecordKind DataGroup::own_payload(ChannelGroup& group, Waiting& frame) {
  BinaryInput& payloads = *group.payloads;
  const std::uint64_t position = payloads.position();
  if (frame.offset < position)
    return bad(0, "data bytes that stand before those of earlier frames");
  std::optional<std::string_view> head;
  if (payloads.skip(frame.offset - position)) head = payloads.peek(4);
  const std::uint32_t size = head ? Fields(*head).u32(0) : 0;
  if (head && size < frame.length) {
    return bad(0, "fewer data bytes than the frame's length says");
  }
  std::optional<std::string_view> bytes;
  if (head) {
    payloads.take(4);
    bytes = payloads.take(frame.length);
  }
  if (!bytes) {
    return bad(0, payloads.fault().empty() ? "a frame whose data bytes are not in the file"
                                           : payloads.fault());
  }
  fill(frame.ready.frame, frame.length, *bytes);
  return RecordKind::kNothing;
}

}  // namespace beltgrip::can::mdf
