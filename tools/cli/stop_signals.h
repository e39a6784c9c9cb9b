// How a tool ends before its time: by SIGTERM within half a second whatever it does, without a half
// written file beside an output. A tool that can end in good order asks for a word first. Tools
// only.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace beltgrip::cli {

// In main, before any thread. A signal that was ignored when the program began stays so.
void take_stop_signals();

// From now on SIGTERM and SIGINT ask the tool to end by itself: it has 0.4 s after SIGTERM, 5 s
// after SIGINT; a second SIGINT ends it at once.
void end_in_good_order();
bool stop_asked();
// The same, as a descriptor that is readable once one of them has come.
int stop_descriptor();

// A log that comes through a pipe or standard input has no other end than such a signal: it is
// taken as the end, and what came before is used as ever. Files only: nothing changes.
void end_streams_when_stopped(const std::vector<std::string>& logs);
// And logs that are all files end with SIGINT: what was read until then is used.
void end_logs_when_stopped(const std::vector<std::string>& logs);
// A drive in virtual time ends with SIGINT as such a log does.
void end_drives_when_stopped();
// Once all is written: says that logs which are files, or a drive, have been cut, and ends as the
// signal would.
void end_if_cut();

// Called where a signal ends the program; async-signal-safe.
void call_when_stopped(void (*last)());

// A file that is removed where a signal ends the program. Nothing to remove: kNoSlot.
inline constexpr std::size_t kNoSlot = ~std::size_t{0};
std::size_t remove_when_stopped(const std::string& path);
void keep_when_stopped(std::size_t slot);

}  // namespace beltgrip::cli
