// Measurements of bus loggers (.mf4, MDF 4): CAN frames as records of channel groups, finished or
// not, sorted (a group of records for each kind of frame, merged here by time) or not.
#include <algorithm>

#include "can_dbc/log/binary.h"
#include "can_dbc/log/mdf/group.h"

namespace beltgrip::can {

namespace {

constexpr std::size_t kIdentification = 64;
constexpr std::size_t kHeaderFields = 8;
constexpr std::uint16_t kVersionLeast = 400;
constexpr std::size_t kFrameGroupsMost = 256;  // that are merged by time: each has its buffers

class MdfParser : public BinaryParser {
 public:
  MdfParser(std::unique_ptr<ByteSource> source, std::string path)
      : source_(std::move(source)), path_(std::move(path)) {}

 private:
  RecordKind step(LogRecord& record) override {
    if (file_ == nullptr) return open();
    // Each group has its next frame ready, or none left; the earliest is the next of the log.
    mdf::DataGroup* earliest = nullptr;
    for (std::size_t i = 0; i < groups_.size(); ++i) {
      mdf::DataGroup& group = *groups_[i];
      const RecordKind kind = group.step();
      if (kind == RecordKind::kBad) return bad(group.byte(), group.reason());
      if (kind == RecordKind::kNothing) return kind;
      if (kind == RecordKind::kEnd) {
        groups_.erase(groups_.begin() + static_cast<std::ptrdiff_t>(i--));
        continue;
      }
      if (earliest == nullptr || group.front()->t_ns < earliest->front()->t_ns) earliest = &group;
    }
    if (earliest == nullptr) {
      return file_->fault().empty() ? end() : broken(file_->size(), file_->fault());
    }
    const mdf::ReadyFrame& frame = *earliest->front();
    record.t_ns = frame.t_ns;
    record.frame = frame.frame;
    record.sent = frame.sent;
    channel_ = std::to_string(frame.channel);
    record.interface = channel_;
    earliest->pop();
    return RecordKind::kFrame;
  }

  RecordKind open() {
    try {
      file_ = std::make_unique<mdf::File>(std::move(source_), path_);
      return open_groups();
    } catch (const mdf::MdfError& error) {
      groups_.clear();
      const bool cut = file_ != nullptr && !file_->fault().empty();
      return broken(error.byte, cut ? file_->fault() : error.reason);
    }
  }

  RecordKind open_groups() {
    std::string head(kIdentification, '\0');
    if (file_->read_at(0, head.data(), head.size()) < head.size()) {
      return broken(0, "the file's identification is cut off by the end of the file");
    }
    constexpr std::size_t kVersion = 28;
    const Fields identification(head);
    const bool finished = head.starts_with("MDF ");
    if (identification.u16(kVersion) < kVersionLeast) {
      return broken(0, "an MDF measurement of version " + head.substr(8, 4) + ", expected 4");
    }
    const mdf::Block header = file_->block(kIdentification);
    const std::string fields = file_->data(header, kHeaderFields);
    if (header.id != "##HD" || header.links.empty() || fields.size() < kHeaderFields) {
      return broken(kIdentification, "no header where one should be, expected ##HD");
    }
    const auto start_ns = static_cast<std::int64_t>(Fields(fields).u64(0));
    std::size_t described = 0;
    for (std::uint64_t link = header.links[0]; link != 0;) {
      const mdf::Block block = file_->block(link);
      auto group = std::make_unique<mdf::DataGroup>(*file_, block, finished, start_ns);
      described += group->channel_groups();
      if (group->has_frames()) groups_.push_back(std::move(group));
      if (groups_.size() > kFrameGroupsMost) {
        throw mdf::MdfError{link, "more than 256 data groups of CAN frames"};
      }
      link = block.links[0];
    }
    if (groups_.empty()) {
      return broken(0, "an MDF measurement without CAN frames, of " + std::to_string(described) +
                           " group" + (described == 1 ? "" : "s") +
                           " of signals; expected a bus log. Export the signals as .csv");
    }
    return RecordKind::kNothing;
  }

  std::unique_ptr<ByteSource> source_;
  std::string path_;
  std::unique_ptr<mdf::File> file_;
  std::vector<std::unique_ptr<mdf::DataGroup>> groups_;
  std::string channel_;
};

}  // namespace

std::unique_ptr<BinaryParser> make_mdf_parser(std::unique_ptr<ByteSource> source,
                                              const std::string& path) {
  return std::make_unique<MdfParser>(std::move(source), path);
}

}  // namespace beltgrip::can
