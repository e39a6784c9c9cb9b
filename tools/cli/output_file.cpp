#include "tools/cli/output_file.h"

#include <fcntl.h>
#include <linux/fs.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <set>

#include "tools/cli/stop_signals.h"

namespace beltgrip::cli {

namespace {

namespace fs = std::filesystem;
constexpr int kLinksMost = 40;  // as the kernel
constexpr mode_t kPermissions = 07777;

bool is_descriptor(const std::string& path) {
  return path.starts_with("/dev/") || path.starts_with("/proc/");
}

// The file that a path names, behind all links, also where it is not there yet.
std::string behind_links(std::string path) {
  std::error_code error;
  for (int i = 0; i < kLinksMost && fs::is_symlink(fs::symlink_status(path, error)); ++i) {
    path = (fs::path(path).parent_path() / fs::read_symlink(path, error)).string();
    if (error) break;
  }
  return path;
}

// To tell two outputs that are one.
std::string place_of(const std::string& target) {
  std::error_code error;
  const fs::path folder = fs::canonical(fs::absolute(target).parent_path(), error);
  return (folder / fs::path(target).filename()).string();
}

std::set<std::string>& places_taken() {
  static std::set<std::string> places;
  return places;
}

bool is_named_as_recording(const std::string& target) {
  constexpr std::array kEndings{".csv", ".log", ".asc", ".trc", ".blf", ".mf4", ".pcap", ".pcapng"};
  const std::string ending = fs::path(target).extension().string();
  return std::find(kEndings.begin(), kEndings.end(), ending) != kEndings.end();
}

}  // namespace

void Inputs::add(const std::string& path) {
  struct stat found {};
  const bool there = path == "-" ? fstat(STDIN_FILENO, &found) == 0
                                 : !path.empty() && stat(path.c_str(), &found) == 0;
  if (there && S_ISREG(found.st_mode)) files_.push_back({found.st_dev, found.st_ino, path});
}

void Inputs::add(const std::vector<std::string>& paths) {
  for (const std::string& path : paths) add(path);
}

void Inputs::demand_apart(const std::string& path) const {
  struct stat found {};
  const bool there =
      path == "-" ? fstat(STDOUT_FILENO, &found) == 0 : stat(path.c_str(), &found) == 0;
  if (!there) return;
  for (const Identity& each : files_) {
    if (each.device != found.st_dev || each.inode != found.st_ino) continue;
    const auto name = [](const std::string& given, const char* stream) {
      return given == "-" ? std::string(stream) : given;
    };
    throw Failure{kUsage, name(path, "standard output") + ": found an output that is an input (" +
                              name(each.path, "standard input") + "), expected another file"};
  }
}

OutputFile::OutputFile(const std::string& path, const Inputs& inputs, Existing existing)
    : path_(path), slot_(kNoSlot), replace_(existing != Existing::kKeep) {
  inputs.demand_apart(path);
  if (path == "-") {
    file_ = stdout;
    return;
  }
  struct stat there {};
  const bool exists = stat(path.c_str(), &there) == 0;
  if (is_descriptor(path) || (exists && !S_ISREG(there.st_mode))) {
    file_ = std::fopen(path.c_str(), "wb");
    if (file_ == nullptr) fail_to_create(errno);
    return;
  }
  if (exists && !replace_) {
    throw Failure{kCannotCreate, path + ": found a file, expected none (--force replaces it)"};
  }
  target_ = behind_links(path);
  if (exists && existing == Existing::kReplaceResult && is_named_as_recording(target_)) {
    throw Failure{kUsage, path +
                              ": found a recording, expected the name of the result (of run*.csv "
                              "a shell makes several names)"};
  }
  if (!places_taken().insert(place_of(target_)).second) {
    throw Failure{kUsage, path + ": found as the file of two outputs, expected a file for each"};
  }
  open_beside(exists ? &there : nullptr);
}

void OutputFile::open_beside(const struct stat* there) {
  // What may not be written is not replaced either.
  if (there != nullptr && access(target_.c_str(), W_OK) != 0) fail_to_create(errno);
  const fs::path folder = fs::path(target_).parent_path();
  int fd = -1;
  for (int i = 0; fd < 0 && i < 1000; ++i) {
    const std::string name =
        ".beltgrip-" + std::to_string(getpid()) + "-" + std::to_string(i) + ".part";
    beside_ = (folder / name).string();
    fd = ::open(beside_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd < 0 && errno != EEXIST) break;
  }
  if (fd < 0) {
    const int error = errno;
    beside_.clear();
    fail_to_create(error);
  }
  slot_ = remove_when_stopped(beside_);
  if (there != nullptr) static_cast<void>(!fchmod(fd, there->st_mode & kPermissions));
  file_ = fdopen(fd, "wb");
}

void OutputFile::fail_to_create(int error) const {
  throw Failure{kCannotCreate, path_ + ": cannot be created: " + std::strerror(error)};
}

void OutputFile::drop() {
  if (beside_.empty()) return;
  unlink(beside_.c_str());
  keep_when_stopped(slot_);
  beside_.clear();
}

OutputFile::~OutputFile() {
  if (file_ != nullptr && file_ != stdout) std::fclose(file_);
  drop();
}

void OutputFile::close() {
  const auto fail = [&](int error) {
    drop();
    throw Failure{kCannotWrite, path_ + ": cannot be written: " + std::strerror(error)};
  };
  std::FILE* const file = file_;
  file_ = nullptr;
  const bool bad = std::ferror(file) != 0;
  const bool unflushed = file == stdout ? std::fflush(file) != 0 : std::fclose(file) != 0;
  if (bad || unflushed) fail(errno);
  if (beside_.empty()) return;
  // Another program may have made it meanwhile.
  int result = -1;
  if (!replace_) {
    result = renameat2(AT_FDCWD, beside_.c_str(), AT_FDCWD, target_.c_str(), RENAME_NOREPLACE);
  }
  if (replace_ || (result != 0 && (errno == EINVAL || errno == ENOSYS))) {
    result = std::rename(beside_.c_str(), target_.c_str());
  }
  if (result != 0) fail(errno);
  keep_when_stopped(slot_);
  beside_.clear();
}

void write_file(const std::string& path, const Inputs& inputs, std::string_view text,
                Existing existing) {
  OutputFile file(path, inputs, existing);
  file.write(text);
  file.close();
}

}  // namespace beltgrip::cli
