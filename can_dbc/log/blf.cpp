// Vector's binary log (.blf): objects, nearly all of them inside containers that are packed with
// zlib. Objects may begin in one container and end in the next, so the contents of all containers
// are one stream, in which the frames are found. Times count from the start of the measurement,
// which the header tells as a date, read as universal time.
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <deque>
#include <limits>

#include "can_dbc/log/binary.h"
#include "can_dbc/log/frame_bits.h"
#include "can_dbc/log/text.h"

namespace beltgrip::can {

namespace {

constexpr std::string_view kObjectMark = "LOBJ";
constexpr std::size_t kBaseHeader = 16;
constexpr std::size_t kContainerHeader = 32;
constexpr std::size_t kFileHeaderLeast = 72;
constexpr std::size_t kTimedHeader = 32;   // of every object that has a time
constexpr std::size_t kPaddingMost = 3;    // between objects
constexpr std::size_t kObjectKept = 1024;  // of an object: more than any frame has

enum ObjectType : std::uint32_t {
  kCanMessage = 1,
  kCanError = 2,
  kContainer = 10,
  kCanErrorExt = 73,
  kCanMessage2 = 86,
  kCanFdMessage = 100,
  kCanFdMessage64 = 101,
  kCanFdError64 = 104
};
enum Packing : std::uint16_t { kNotPacked = 0, kZlib = 2 };

constexpr std::uint32_t kTenMicroseconds = 1;  // flag of an object's time; else nanoseconds
constexpr std::int64_t kTenMicroseconds_ns = 10'000;

// The contents of all containers, one behind the other.
class ContainerSource : public ByteSource {
 public:
  explicit ContainerSource(BinaryInput& file) : file_(file) {}
  ~ContainerSource() override { close(); }
  ContainerSource(const ContainerSource&) = delete;
  ContainerSource& operator=(const ContainerSource&) = delete;

  std::size_t read(std::span<char> out) override {
    while (fault_.empty()) {
      if (left_ == 0 && !unpacking_) {
        if (!next_object()) return 0;
        continue;
      }
      const std::size_t count = unpacking_ ? unpack(out) : copy(out);
      given_ += count;
      if (count > 0) return count;
    }
    return 0;
  }
  const std::string& fault() const override { return fault_; }
  bool ready(int) override { return true; }

  // Where in the file the object stands that holds this byte of the stream. Asked with growing
  // places.
  std::uint64_t place_of(std::uint64_t streamed) {
    while (starts_.size() > 1 && starts_[1].streamed <= streamed) starts_.pop_front();
    return starts_.empty() ? file_.position() : starts_.front().in_file;
  }

 private:
  struct Start {
    std::uint64_t streamed, in_file;
  };

  void note_start() {
    if (!starts_.empty() && starts_.back().streamed == given_) starts_.pop_back();
    starts_.push_back({given_, at_});
    // The reader of the stream is behind by no more bytes than these.
    if (starts_.size() > BinaryInput::kTakeMost) starts_.pop_front();
  }

  bool fail(const std::string& reason) {
    fault_ = file_.fault().empty() ? reason : file_.fault();
    note_start();
    return false;
  }

  // An object that is no container stands in the stream as it is.
  bool next_object() {
    close();
    at_ = file_.position();
    if (file_.at_end()) return file_.fault().empty() ? false : fail("");
    auto head = file_.peek(kBaseHeader);
    for (std::size_t i = 0; i < kPaddingMost && head && !head->starts_with(kObjectMark); ++i) {
      file_.skip(1);
      head = file_.peek(kBaseHeader);
    }
    if (!head || head->starts_with(kObjectMark)) at_ = file_.position();
    if (!head) return is_padding() ? false : fail("an object is cut off by the end of the file");
    if (!head->starts_with(kObjectMark)) {
      return fail("no object where one should begin, expected LOBJ: damaged, or not finished");
    }
    const Fields object(*head);
    left_ = object.u32(8);
    note_start();
    if (object.u32(12) != kContainer) {
      left_ = std::max<std::uint64_t>(left_, kBaseHeader);
      return true;
    }
    if (left_ < kContainerHeader) return fail("a container of less than its 32 bytes of header");
    const auto container = file_.take(kContainerHeader);
    if (!container) return fail("a container is cut off by the end of the file");
    left_ -= kContainerHeader;
    const std::uint16_t packing = Fields(*container).u16(kBaseHeader);
    if (packing == kNotPacked) return true;
    if (packing != kZlib)
      return fail("a container packed by method " + std::to_string(packing) +
                  ", expected 0 (not packed) or 2 (zlib)");
    stream_ = {};
    if (inflateInit(&stream_) != Z_OK) return fail("out of memory");
    unpacking_ = true;
    return true;
  }

  bool is_padding() {
    while (const auto byte = file_.take(1)) {
      if ((*byte)[0] != '\0') return false;
    }
    return file_.fault().empty();
  }

  std::optional<std::string_view> piece(std::size_t most) {
    if (file_.at_end()) {
      fail("a container is cut off by the end of the file");
      return std::nullopt;
    }
    const auto size =
        static_cast<std::size_t>(std::min<std::uint64_t>({left_, file_.buffered(), most}));
    left_ -= size;
    return file_.take(size);
  }

  std::size_t copy(std::span<char> out) {
    const auto bytes = piece(out.size());
    if (!bytes) return 0;
    std::copy(bytes->begin(), bytes->end(), out.begin());
    return bytes->size();
  }

  std::size_t unpack(std::span<char> out) {
    stream_.next_out = reinterpret_cast<Bytef*>(out.data());
    stream_.avail_out = static_cast<uInt>(out.size());
    while (stream_.avail_out == out.size()) {
      if (stream_.avail_in == 0 && left_ > 0) {
        const auto bytes = piece(packed_.size());
        if (!bytes) break;
        std::copy(bytes->begin(), bytes->end(), packed_.begin());
        stream_.next_in = reinterpret_cast<Bytef*>(packed_.data());
        stream_.avail_in = static_cast<uInt>(bytes->size());
      }
      // Without a byte going in, more may still come out.
      const bool fed = stream_.avail_in > 0;
      const int status = inflate(&stream_, Z_NO_FLUSH);
      if (status == Z_STREAM_END) {
        const std::size_t count = out.size() - stream_.avail_out;
        const std::uint64_t rest = left_;
        close();
        left_ = 0;
        if (!file_.skip(rest)) fail("a container is cut off by the end of the file");
        return count;
      }
      if (status != Z_OK && status != Z_BUF_ERROR) {
        fail("a container with damaged packed data");
        break;
      }
      if (!fed && stream_.avail_out == out.size()) {
        fail("a container whose packed data end before their end");
        break;
      }
    }
    return out.size() - stream_.avail_out;
  }

  void close() {
    if (unpacking_) inflateEnd(&stream_);
    unpacking_ = false;
  }

  BinaryInput& file_;
  std::string fault_;
  std::uint64_t at_ = 0;    // of the object in the file
  std::uint64_t left_ = 0;  // of its bytes
  std::uint64_t given_ = 0;
  bool unpacking_ = false;
  z_stream stream_{};
  std::array<char, std::size_t{16} * 1024> packed_{};
  std::deque<Start> starts_;
};

class BlfParser : public BinaryParser {
 public:
  explicit BlfParser(std::unique_ptr<ByteSource> source) : file_(std::move(source)) {
    auto containers = std::make_unique<ContainerSource>(file_);
    containers_ = containers.get();
    objects_ = std::make_unique<BinaryInput>(std::move(containers));
  }

 private:
  RecordKind step(LogRecord& record) override {
    if (!has_header_) return read_file_header();
    const std::uint64_t begin = objects_->position();
    if (objects_->at_end()) return at_end(begin, "");
    if (const RecordKind found = find_object(begin); found != RecordKind::kFrame) return found;
    const std::uint64_t streamed = objects_->position();
    const std::uint64_t place = containers_->place_of(streamed);
    const auto base = objects_->peek(kBaseHeader);
    if (!base) return at_end(streamed, "an object is cut off by the end of the file");
    const std::uint32_t size = Fields(*base).u32(8);
    if (size < kBaseHeader) {
      objects_->skip(kObjectMark.size());
      return bad(place, "an object of " + std::to_string(size) + " bytes, expected at least 16");
    }
    const std::size_t kept = std::min<std::size_t>(size, kObjectKept);
    const auto bytes = objects_->take(kept);
    if (!bytes) return at_end(streamed, "an object is cut off by the end of the file");
    const char* reason = nullptr;
    const bool is_frame = read_object(Fields(*bytes), record, reason);
    if (!objects_->skip(size - kept)) {
      return at_end(streamed, "an object is cut off by the end of the file");
    }
    if (reason != nullptr) return bad(place, reason);
    return is_frame ? RecordKind::kFrame : RecordKind::kNothing;
  }

  RecordKind at_end(std::uint64_t streamed, std::string reason) {
    const std::string& fault = objects_->fault();
    if (!fault.empty()) reason = fault;
    if (reason.empty()) return end();
    return broken(containers_->place_of(fault.empty() ? streamed : UINT64_MAX), std::move(reason));
  }

  // kFrame: it begins here. Between objects are a few bytes of padding; where there is more, the
  // next object is looked for.
  RecordKind find_object(std::uint64_t begin) {
    std::uint64_t passed = 0;
    auto mark = objects_->peek(kObjectMark.size());
    while (mark && *mark != kObjectMark) {
      objects_->skip(1);
      ++passed;
      mark = objects_->peek(kObjectMark.size());
    }
    if (!mark && passed <= kPaddingMost && !objects_->at_end()) objects_->skip(kPaddingMost);
    if (passed > kPaddingMost) {
      return bad(containers_->place_of(begin),
                 std::to_string(passed) + " bytes that are no object, expected LOBJ");
    }
    return mark ? RecordKind::kFrame : RecordKind::kNothing;
  }

  RecordKind read_file_header() {
    const auto head = file_.peek(kFileHeaderLeast);
    if (!head) return cut(0, file_, "the file's header");
    const Fields header(*head);
    const std::uint32_t size = header.u32(4);
    if (size < kFileHeaderLeast) {
      return broken(0, "a file header of " + std::to_string(size) + " bytes, expected 144");
    }
    constexpr std::size_t kStart = 40;  // year, month, weekday, day, hour, minute, second, ms
    std::array<char, 64> date{};
    std::snprintf(date.data(), date.size(), "%04u-%02u-%02uT%02u:%02u:%02u.%03u",
                  header.u16(kStart), header.u16(kStart + 2), header.u16(kStart + 6),
                  header.u16(kStart + 8), header.u16(kStart + 10), header.u16(kStart + 12),
                  header.u16(kStart + 14));
    start_ns_ = log_text::date_ns(date.data()).value_or(0);  // none: times from zero
    if (!file_.skip(size)) return cut(0, file_, "the file's header");
    has_header_ = true;
    return RecordKind::kNothing;
  }

  // False: no frame. `reason` is set where it should have been one.
  bool read_object(const Fields& object, LogRecord& record, const char*& reason) {
    const std::uint32_t type = object.u32(12);
    const Shape* const shape = std::find_if(kShapes.begin(), kShapes.end(),
                                            [&](const Shape& s) { return s.type == type; });
    if (shape == kShapes.end()) return false;
    const std::size_t body = object.u16(4);
    if (body < kTimedHeader || object.size() < body || object.size() - body < shape->least) {
      reason = "an object too short for its type";
      return false;
    }
    const std::uint64_t ticks = object.u64(24);
    const std::int64_t unit_ns = object.u32(16) == kTenMicroseconds ? kTenMicroseconds_ns : 1;
    std::int64_t time_ns = 0;
    if (ticks > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max()) ||
        __builtin_mul_overflow(static_cast<std::int64_t>(ticks), unit_ns, &time_ns) ||
        __builtin_add_overflow(time_ns, start_ns_, &record.t_ns)) {
      reason = "time stamp beyond the range";
      return false;
    }
    record.frame = CanFrame{};
    reason = (this->*shape->read)(Fields(object.text(body, object.size() - body)), record);
    record.interface = channel_;
    return reason == nullptr;
  }

  // Those of the body of an object; nullptr: done.
  const char* read_error(const Fields& body, LogRecord& record) {
    channel_ = std::to_string(body.u16(0));
    record.frame.error = true;
    record.frame.id.value = kBusError;
    record.frame.length = kErrorLength;
    return nullptr;
  }
  const char* read_fd_error(const Fields& body, LogRecord& record) {
    read_error(body, record);
    channel_ = std::to_string(body.u8(0));
    return nullptr;
  }

  const char* read_classic(const Fields& body, LogRecord& record) {
    channel_ = std::to_string(body.u16(0));
    record.sent = (body.u8(2) & kSentFlag) != 0;
    record.frame.remote = (body.u8(2) & kRemoteFlag) != 0;
    return read_frame(body, 4, body.u8(3), body.u8(3), 8, record.frame);
  }

  const char* read_fd(const Fields& body, LogRecord& record) {
    channel_ = std::to_string(body.u16(0));
    record.sent = (body.u8(2) & kSentFlag) != 0;
    const std::uint8_t flags = body.u8(13);
    record.frame.remote = (body.u8(2) & kRemoteFlag) != 0;
    set_fd(record.frame, (flags & 1U) != 0, (flags & 2U) != 0, (flags & 4U) != 0);
    return read_frame(body, 4, body.u8(3), body.u8(14), 20, record.frame);
  }

  const char* read_fd64(const Fields& body, LogRecord& record) {
    channel_ = std::to_string(body.u8(0));
    const std::uint32_t flags = body.u32(12);
    record.sent = body.u8(34) != 0;
    record.frame.remote = (flags & 0x10U) != 0;
    set_fd(record.frame, (flags & 0x1000U) != 0, (flags & 0x2000U) != 0, (flags & 0x4000U) != 0);
    return read_frame(body, 4, body.u8(1), body.u8(2), 40, record.frame);
  }

  // CAN FD knows no remote frames: where both are marked, the data count.
  static void set_fd(CanFrame& frame, bool fd, bool bit_rate_switch, bool error_state) {
    frame.fd = fd;
    frame.remote = frame.remote && !fd;
    frame.bit_rate_switch = fd && bit_rate_switch;
    frame.error_state_indicator = fd && error_state;
  }

  // An identifier above 0x7FF can only be an extended one, marked or not.
  static const char* read_frame(const Fields& body, std::size_t id_at, std::size_t code,
                                std::size_t length, std::size_t data_at, CanFrame& frame) {
    const std::uint32_t id = body.u32(id_at);
    frame.id.value = id & kExtendedIdMax;
    frame.id.extended = (id & kExtendedFlag) != 0 || frame.id.value > kStandardIdMax;
    constexpr std::size_t kClassicMost = 8;
    if (frame.remote) {
      frame.length = static_cast<std::uint8_t>(std::min(code, kClassicMost));
      return nullptr;
    }
    if (!frame.fd) length = std::min(length, kClassicMost);
    if (length > kMaxPayload) return "data length above 64";
    if (body.size() < data_at + length) return "fewer data bytes than the length says";
    frame.length = static_cast<std::uint8_t>(length);
    const std::string_view data = body.text(data_at, length);
    std::copy(data.begin(), data.end(), frame.data.begin());
    return nullptr;
  }

  struct Shape {
    std::uint32_t type;
    std::size_t least;  // bytes behind the header, without data of variable length
    const char* (BlfParser::*read)(const Fields& body, LogRecord& record);
  };
  static constexpr std::uint8_t kSentFlag = 0x01;
  static constexpr std::uint8_t kRemoteFlag = 0x80;
  static constexpr std::array<Shape, 7> kShapes{{{kCanMessage, 16, &BlfParser::read_classic},
                                                 {kCanMessage2, 16, &BlfParser::read_classic},
                                                 {kCanFdMessage, 20, &BlfParser::read_fd},
                                                 {kCanFdMessage64, 40, &BlfParser::read_fd64},
                                                 {kCanError, 4, &BlfParser::read_error},
                                                 {kCanErrorExt, 32, &BlfParser::read_error},
                                                 {kCanFdError64, 4, &BlfParser::read_fd_error}}};

  BinaryInput file_;
  ContainerSource* containers_ = nullptr;  // of objects_
  std::unique_ptr<BinaryInput> objects_;
  bool has_header_ = false;
  std::int64_t start_ns_ = 0;
  std::string channel_;
};

}  // namespace

std::unique_ptr<BinaryParser> make_blf_parser(std::unique_ptr<ByteSource> source) {
  return std::make_unique<BlfParser>(std::move(source));
}

}  // namespace beltgrip::can
