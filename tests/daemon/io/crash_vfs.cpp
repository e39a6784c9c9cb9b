#include "tests/daemon/io/crash_vfs.h"

#include <sqlite3.h>

#include <cstring>
#include <new>

namespace beltgrip::test {
namespace {

using Kind = FileOperation::Kind;

CrashVfs* current = nullptr;
sqlite3_vfs* real_vfs = nullptr;

struct File {
  sqlite3_file base;
  sqlite3_file* real;
  std::string* name;
};

File* of(sqlite3_file* file) { return reinterpret_cast<File*>(file); }
sqlite3_file* real(sqlite3_file* file) { return of(file)->real; }

std::string last_part(const char* path) {
  const std::string text = path == nullptr ? "" : path;
  return text.substr(text.rfind('/') + 1);
}

int fault(int CrashVfs::*fail_at = &CrashVfs::fail_at) {
  if (current == nullptr || current->*fail_at < 0) return SQLITE_OK;
  if (current->*fail_at > 0) --(current->*fail_at);
  return current->*fail_at == 0 ? current->fail_with : SQLITE_OK;
}

// The write-ahead index is memory: it does not survive.
bool counts(const std::string& name) { return !name.empty() && !name.ends_with("-shm"); }

int close_file(sqlite3_file* file) {
  const int status = real(file)->pMethods->xClose(real(file));
  delete of(file)->name;
  ::operator delete(of(file)->real);
  return status;
}
int read_file(sqlite3_file* file, void* out, int size, sqlite3_int64 at) {
  if (const int failed = fault(&CrashVfs::fail_read_at)) return failed;
  return real(file)->pMethods->xRead(real(file), out, size, at);
}
int write_file(sqlite3_file* file, const void* bytes, int size, sqlite3_int64 at) {
  if (const int failed = fault()) return failed;
  if (current != nullptr && counts(*of(file)->name)) {
    current->operations.push_back(
        {Kind::kWrite,
         *of(file)->name,
         at,
         {static_cast<const char*>(bytes), static_cast<std::size_t>(size)}});
  }
  return real(file)->pMethods->xWrite(real(file), bytes, size, at);
}
int truncate_file(sqlite3_file* file, sqlite3_int64 size) {
  if (const int failed = fault()) return failed;
  if (current != nullptr && counts(*of(file)->name)) {
    current->operations.push_back({Kind::kTruncate, *of(file)->name, size, {}});
  }
  return real(file)->pMethods->xTruncate(real(file), size);
}
int sync_file(sqlite3_file* file, int) {
  if (const int failed = fault()) return failed;
  if (current != nullptr && counts(*of(file)->name)) {
    current->operations.push_back({Kind::kSync, *of(file)->name, 0, {}});
  }
  return SQLITE_OK;  // nothing here needs to last
}
int file_size(sqlite3_file* file, sqlite3_int64* size) {
  return real(file)->pMethods->xFileSize(real(file), size);
}
int lock(sqlite3_file* file, int level) { return real(file)->pMethods->xLock(real(file), level); }
int unlock(sqlite3_file* file, int level) {
  return real(file)->pMethods->xUnlock(real(file), level);
}
int check_lock(sqlite3_file* file, int* out) {
  return real(file)->pMethods->xCheckReservedLock(real(file), out);
}
int control(sqlite3_file* file, int what, void* with) {
  return real(file)->pMethods->xFileControl(real(file), what, with);
}
int sector_size(sqlite3_file* file) { return real(file)->pMethods->xSectorSize(real(file)); }
int characteristics(sqlite3_file* file) {
  return real(file)->pMethods->xDeviceCharacteristics(real(file));
}
int shm_map(sqlite3_file* file, int region, int size, int extend, void volatile** out) {
  return real(file)->pMethods->xShmMap(real(file), region, size, extend, out);
}
int shm_lock(sqlite3_file* file, int offset, int count, int flags) {
  return real(file)->pMethods->xShmLock(real(file), offset, count, flags);
}
void shm_barrier(sqlite3_file* file) { real(file)->pMethods->xShmBarrier(real(file)); }
int shm_unmap(sqlite3_file* file, int remove) {
  return real(file)->pMethods->xShmUnmap(real(file), remove);
}

const sqlite3_io_methods kMethods = {
    2,        close_file,  read_file,  write_file, truncate_file, sync_file,       file_size,
    lock,     unlock,      check_lock, control,    sector_size,   characteristics, shm_map,
    shm_lock, shm_barrier, shm_unmap,  nullptr,    nullptr};

int open_file(sqlite3_vfs*, const char* path, sqlite3_file* file, int flags, int* out_flags) {
  File* mine = of(file);
  mine->base.pMethods = nullptr;
  mine->real =
      static_cast<sqlite3_file*>(::operator new(static_cast<std::size_t>(real_vfs->szOsFile)));
  std::memset(mine->real, 0, static_cast<std::size_t>(real_vfs->szOsFile));
  const int status = real_vfs->xOpen(real_vfs, path, mine->real, flags, out_flags);
  if (status != SQLITE_OK) {
    ::operator delete(mine->real);
    return status;
  }
  mine->name = new std::string(last_part(path));
  mine->base.pMethods = &kMethods;
  return SQLITE_OK;
}

int delete_file(sqlite3_vfs*, const char* path, int sync) {
  if (const int failed = fault()) return failed;
  if (current != nullptr && counts(last_part(path))) {
    current->operations.push_back({Kind::kDelete, last_part(path), 0, {}});
  }
  return real_vfs->xDelete(real_vfs, path, sync);
}

sqlite3_vfs crash_vfs;

}  // namespace

CrashVfs::CrashVfs() {
  current = this;
  real_vfs = sqlite3_vfs_find(nullptr);
  crash_vfs = *real_vfs;
  crash_vfs.szOsFile = sizeof(File);
  crash_vfs.pNext = nullptr;
  crash_vfs.zName = "crash";
  crash_vfs.xOpen = open_file;
  crash_vfs.xDelete = delete_file;
  sqlite3_vfs_register(&crash_vfs, 1);
}

CrashVfs::~CrashVfs() {
  sqlite3_vfs_unregister(&crash_vfs);
  sqlite3_vfs_register(real_vfs, 1);
  current = nullptr;
}

Files after(Files files, const std::vector<FileOperation>& operations, std::size_t count,
            std::size_t partial, int lost) {
  for (std::size_t i = 0; i < operations.size() && i <= count; ++i) {
    const FileOperation& each = operations[i];
    if (static_cast<int>(i) == lost) continue;
    if (i == count && (each.kind != Kind::kWrite || partial == 0)) break;
    if (each.kind == Kind::kDelete) files.erase(each.file);
    if (each.kind == Kind::kTruncate) {
      files[each.file].resize(static_cast<std::size_t>(each.offset));
    }
    if (each.kind != Kind::kWrite) continue;
    const std::string bytes = i == count ? each.bytes.substr(0, partial) : each.bytes;
    std::string& content = files[each.file];
    const std::size_t end = static_cast<std::size_t>(each.offset) + bytes.size();
    if (content.size() < end) content.resize(end);
    content.replace(static_cast<std::size_t>(each.offset), bytes.size(), bytes);
  }
  return files;
}

}  // namespace beltgrip::test
