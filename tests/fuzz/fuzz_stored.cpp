// Any bytes as what the daemon keeps between drives, the history's file and that of the observed
// bound: read, told to be of no use, or read in part; every row that is given is whole, and neither
// file is changed by reading.
#include <unistd.h>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>

#include "daemon/io/carried_keeper.h"
#include "daemon/io/history_db.h"

namespace {

using namespace beltgrip::daemon;

void require(bool condition, int line = __builtin_LINE()) {
  if (condition) return;
  std::fprintf(stderr, "fuzz_stored.cpp:%d\n", line);
  std::abort();
}

class Folder {
 public:
  Folder() : path_((std::filesystem::temp_directory_path() / "fuzz_stored.XXXXXX").string()) {
    require(mkdtemp(path_.data()) != nullptr);
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

std::string bytes_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void read_history(const std::string& path) {
  const HistoryDb::Opened opened = HistoryDb::open_to_read(path);
  require(opened.db != nullptr || opened.trouble != HistoryTrouble::kNone);
  if (opened.db == nullptr) return;
  const HistoryContent content = opened.db->read();
  require(content.damaged >= 0);
  std::int64_t last = std::numeric_limits<std::int64_t>::min();
  for (const HistoryRow& row : content.rows) {
    require(row.id > last);
    last = row.id;
    if (row.result.peak.kind != beltgrip::estimator::PeakKind::kValue) continue;
    require(std::isfinite(row.result.peak.mu_max));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Folder folder;
  const std::string content(reinterpret_cast<const char*>(data), size);
  const std::string history = folder.path() + "/" + kHistoryFile;
  const std::string carried = folder.path() + "/" + kCarriedFile;
  for (const std::string& path : {history, carried}) {
    std::ofstream(path, std::ios::binary) << content;
  }
  read_history(history);
  const auto bounds = read_carried(folder.path(), "");
  if (bounds) {
    for (const CarriedBound& bound : *bounds) {
      require(std::isfinite(bound.mu_star) && std::isfinite(bound.mu_max_least));
    }
  } else {
    require(!bounds.error().empty());
  }
  for (const std::string& path : {history, carried}) require(bytes_of(path) == content);
  return 0;
}
