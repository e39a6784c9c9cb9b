// DBC files and logs that the pairs work on, made from fixed seeds.
#pragma once

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

}  // namespace beltgrip::test
