// One data group of an MDF 4 file: its records, one behind the other, as CAN frames. Tools only.
#pragma once

#include <deque>
#include <map>

#include "can_dbc/log/binary.h"
#include "can_dbc/log/mdf/data.h"
#include "can_dbc/log/mdf/layout.h"

namespace beltgrip::can::mdf {

struct ReadyFrame {
  std::int64_t t_ns = 0;
  CanFrame frame;
  std::uint64_t channel = 0;
  bool sent = false;
};

class DataGroup {
 public:
  // Throws MdfError.
  DataGroup(File& file, const Block& group, bool finished, std::int64_t start_ns);
  bool has_frames() const { return has_frames_; }
  std::size_t channel_groups() const { return groups_.size(); }

  // kFrame: front() is filled, until pop(). kEnd: there are no more.
  RecordKind step();
  const ReadyFrame* front() const;
  void pop() { waiting_.pop_front(); }
  const std::string& reason() const { return reason_; }
  std::uint64_t byte() const { return byte_; }

 private:
  struct ChannelGroup {
    bool variable = false;  // records with a length in front, which others point into
    std::size_t record_bytes = 0;
    std::optional<FrameLayout> layout;
    std::uint64_t at = 0;
    std::uint64_t streamed = 0;                   // variable: bytes so far
    std::map<std::uint64_t, std::string> values;  // variable: not asked for yet
    std::unique_ptr<BinaryInput> payloads;        // of frames here, where they have their own
    DataSource* payload_source = nullptr;         // of payloads
  };
  struct Waiting {
    ReadyFrame ready;
    std::size_t length = 0;
    bool whole = true;
    std::uint64_t group = 0, offset = 0;  // where its payload will come from
    std::uint64_t byte = 0;
  };

  void add_group(File& file, const Block& group, bool finished);
  RecordKind step_record();
  RecordKind take_variable(ChannelGroup& group, std::uint64_t at);
  RecordKind take_frame(ChannelGroup& group, const FrameLayout& layout, std::string_view record,
                        std::uint64_t at);
  RecordKind own_payload(ChannelGroup& group, Waiting& frame);
  RecordKind bad(std::uint64_t byte, std::string reason);
  RecordKind end();
  std::optional<std::uint64_t> next_identifier();

  std::int64_t start_ns_;
  unsigned identifier_bytes_ = 0;
  std::map<std::uint64_t, ChannelGroup> groups_;          // by record identifier
  std::map<std::uint64_t, std::uint64_t> identifier_of_;  // by the place of the block
  bool has_frames_ = false;
  DataSource* source_ = nullptr;  // of records_
  std::unique_ptr<BinaryInput> records_;
  std::deque<Waiting> waiting_;
  bool ended_ = false;
  std::string reason_;
  std::uint64_t byte_ = 0;
};

}  // namespace beltgrip::can::mdf
