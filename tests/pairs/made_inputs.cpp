#include "tests/pairs/made_inputs.h"

#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <random>
#include <stdexcept>

#include "can_dbc/log/can_log.h"
#include "can_dbc/log/candump_writer.h"

namespace beltgrip::test {

namespace {
// BeltGrip's own and those of the shipped vehicle lie elsewhere.
constexpr unsigned kForeignId = 0x400;
constexpr unsigned kForeignIds = 64;
}  // namespace

std::string plain_dbc() {
  std::string text =
      "VERSION \"\"\nBS_:\nBU_: Node\n"
      "BO_ 256 Plain: 8 Node\n"
      " SG_ Speed : 0|16@1+ (0.25,0) [0|0] \"\" Node\n"
      " SG_ Torque : 16|12@1- (0.1,-40) [0|0] \"\" Node\n"
      " SG_ Gear : 28|4@1+ (1,0) [0|0] \"\" Node\n"
      " SG_ Pressure : 39|16@0+ (0.01,0) [0|0] \"\" Node\n"
      " SG_ Slope : 55|10@0- (0.5,0) [0|0] \"\" Node\n"
      " SG_ Mode : 61|3@0+ (1,0) [0|0] \"\" Node\n"
      " SG_ Flag : 58|1@0+ (1,0) [0|0] \"\" Node\n"
      " SG_ State : 57|2@0+ (1,0) [0|0] \"\" Node\n"
      "BO_ 512 Cases: 8 Node\n"
      " SG_ Selector M : 0|8@1+ (1,0) [0|0] \"\" Node\n";
  for (int k = 0; k < 16; ++k) {
    const std::string number = std::to_string(k);
    const auto signal = [&](const char* name, const char* rest) {
      text += " SG_ " + std::string(name) + number + " m" + number + " : " + rest +
              " [0|0] \"\" Node\n";
    };
    signal("A", "8|8@1+ (0.5,0)");
    signal("B", "16|16@1+ (0.01,-100)");
    signal("C", "32|12@1+ (0.1,0)");
    signal("D", "44|4@1+ (1,0)");
    signal("E", "48|10@1- (0.25,0)");
    signal("F", "58|6@1+ (1,0)");
  }
  return text;
}

std::string made_dbc(int messages) {
  std::string text = "VERSION \"\"\nBS_:\nBU_: Engine Gateway\n";
  std::string values;
  for (int i = 0; i < messages; ++i) {
    // Beyond the identifiers of 11 bits those of 29, marked by bit 31.
    const std::string id = std::to_string(i < 2000 ? static_cast<unsigned>(i)
                                                   : 0x8000'0000U + static_cast<unsigned>(i));
    text += "BO_ " + id + " Message" + id + ": 8 Engine\n";
    for (int k = 0; k < 8; ++k) {
      text += " SG_ Signal" + std::to_string(k) + " : " + std::to_string(k * 8) +
              "|8@1+ (0.25,-40) [-40|23.75] \"degC\" Gateway\n";
    }
    values += "VAL_ " + id + " Signal0 0 \"off\" 1 \"on\" 2 \"error\" 3 \"not available\" ;\n";
    values += "CM_ SG_ " + id + " Signal1 \"A temperature of the second kind\";\n";
  }
  return text + values;
}

Folder::Folder() {
  std::string name = (std::filesystem::temp_directory_path() / "bench_XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) throw std::runtime_error(name + ": cannot be made");
  folder_ = name;
}

Folder::~Folder() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

void write_text(const std::string& path, const std::string& text) {
  std::ofstream out(path, std::ios::binary);
  out << text;
  if (!out.flush()) throw std::runtime_error(path + ": cannot be written");
}

void write_log(const std::string& path, int frames, unsigned first_id, unsigned ids) {
  std::FILE* out = std::fopen(path.c_str(), "wb");
  if (out == nullptr) throw std::runtime_error(path + ": cannot be written");
  can::CandumpWriter writer(out);
  std::mt19937_64 random(1);
  can::CanFrame frame;
  frame.length = 8;
  constexpr std::int64_t kBegin_ns = 1'700'000'000'000'000'000;
  constexpr std::int64_t kStep_ns = 250'000;
  for (int i = 0; i < frames; ++i) {
    const unsigned id = first_id + static_cast<unsigned>(random() % ids);
    frame.id = id < 2000 ? can::CanId{id, false} : can::CanId{id, true};
    for (std::size_t k = 0; k < 8; ++k) frame.data[k] = static_cast<std::uint8_t>(random());
    writer.write(kBegin_ns + i * kStep_ns, "can0", frame);
  }
  std::fclose(out);
}

namespace {

class DilutedWriter {
 public:
  DilutedWriter(const std::string& path, int foreign)
      : out_(std::fopen(path.c_str(), "wb")), writer_(out_), foreign_(foreign) {
    if (out_ == nullptr) throw std::runtime_error(path + ": cannot be written");
    frame_.length = 8;
  }
  ~DilutedWriter() { std::fclose(out_); }
  DilutedWriter(const DilutedWriter&) = delete;
  DilutedWriter& operator=(const DilutedWriter&) = delete;

  void write(std::int64_t t_ns, const can::LogRecord& record) {
    writer_.write(t_ns, record.interface, record.frame);
    for (int i = 0; i < foreign_; ++i) {
      frame_.id.value = kForeignId + static_cast<unsigned>(random_() % kForeignIds);
      for (std::size_t k = 0; k < 8; ++k) frame_.data[k] = static_cast<std::uint8_t>(random_());
      writer_.write(t_ns, record.interface, frame_);
    }
  }
  std::int64_t bytes() const { return std::ftell(out_); }

 private:
  std::FILE* out_;
  can::CandumpWriter writer_;
  int foreign_;
  std::mt19937_64 random_{2};
  can::CanFrame frame_;
};

}  // namespace

void write_diluted(const std::string& from, const std::string& to, int foreign) {
  DilutedWriter out(to, foreign);
  const auto reader = can::LogReader::open(from);
  can::LogRecord record;
  while (reader->next(record)) out.write(record.t_ns, record);
}

void write_repeated(const std::string& from, const std::string& to, int foreign,
                    std::int64_t bytes) {
  DilutedWriter out(to, foreign);
  constexpr std::int64_t kPause_ns = 1'000'000'000;
  std::int64_t shift_ns = 0;
  while (out.bytes() < bytes) {
    const auto reader = can::LogReader::open(from);
    can::LogRecord record;
    std::int64_t first_ns = 0;
    bool begun = false;
    while (reader->next(record) && out.bytes() < bytes) {
      if (!begun) first_ns = record.t_ns;
      begun = true;
      out.write(record.t_ns + shift_ns, record);
    }
    shift_ns += record.t_ns - first_ns + kPause_ns;
  }
}

void write_as(const std::string& from, const std::string& to) {
  const std::string kind = to.substr(to.rfind('.'));
  std::FILE* out = std::fopen(to.c_str(), "wb");
  if (out == nullptr) throw std::runtime_error(to + ": cannot be written");
  if (kind == ".asc") {
    std::fputs("date Mon Nov 24 06:00:00.000 2025\nbase hex  timestamps absolute\n", out);
  } else if (kind == ".trc") {
    std::fputs(";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n", out);
  } else {
    std::fputs("timestamp,id,extended,dlc,data,bus\n", out);
  }
  const auto reader = can::LogReader::open(from);
  can::LogRecord record;
  std::int64_t first_ns = 0;
  for (long number = 1; reader->next(record); ++number) {
    if (number == 1) first_ns = record.t_ns;
    const auto t_us = static_cast<long long>((record.t_ns - first_ns) / 1000);
    std::string bytes, spaced;
    for (const std::uint8_t byte : record.frame.payload()) {
      std::array<char, 4> text;
      std::snprintf(text.data(), text.size(), "%02X", byte);
      bytes += text.data();
      spaced += std::string(spaced.empty() ? "" : " ") + text.data();
    }
    const unsigned length = record.frame.length;
    if (kind == ".asc") {
      std::fprintf(out, "%4lld.%06lld 1  %-15X Rx   d %u %s  Length = 228000 BitCount = 117\n",
                   t_us / 1'000'000, t_us % 1'000'000, record.frame.id.value, length,
                   spaced.c_str());
    } else if (kind == ".trc") {
      std::fprintf(out, "%7ld %9lld.%03lld DT 1     %04X Rx -  %u    %s\n", number, t_us / 1000,
                   t_us % 1000, record.frame.id.value, length, spaced.c_str());
    } else {
      std::fprintf(out, "%lld.%06lld,0x%X,0,%u,%s,1\n", t_us / 1'000'000, t_us % 1'000'000,
                   record.frame.id.value, length, bytes.c_str());
    }
  }
  std::fclose(out);
}

}  // namespace beltgrip::test
