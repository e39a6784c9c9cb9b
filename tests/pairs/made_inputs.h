// DBC files and logs that the pairs work on, made from fixed seeds.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace beltgrip::test {

// The two messages of plain_decoder.h.
std::string plain_dbc();
constexpr unsigned kPlainId = 256;
constexpr unsigned kCasesId = 512;

// That many messages of 8 bytes, eight signals each, the first with a value table.
std::string made_dbc(int messages);

// A folder that goes with its end.
class Folder {
 public:
  Folder();
  ~Folder();
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  std::string path(const std::string& name) const { return (folder_ / name).string(); }

 private:
  std::filesystem::path folder_;
};

void write_text(const std::string& path, const std::string& text);

// A candump log at 4,000 frames a second: 8 random bytes, identifiers first_id to first_id + ids
// - 1.
void write_log(const std::string& path, int frames, unsigned first_id, unsigned ids);

// Each line of the log once, and behind it `foreign` frames with other identifiers and its stamp.
void write_diluted(const std::string& from, const std::string& to, int foreign);

// The log again and again, each time behind the time before, with `foreign` frames behind each of
// its own, until there are so many bytes.
void write_repeated(const std::string& from, const std::string& to, int foreign,
                    std::int64_t bytes);

// The frames of a candump log in another form: .asc and .trc as the tools of Vector and PEAK write
// them, .csv with a column for all data.
void write_as(const std::string& from, const std::string& to);

}  // namespace beltgrip::test
