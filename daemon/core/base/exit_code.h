// Exit codes of both programs: those of sysexits.h. Start-up and tools.
#pragma once

namespace beltgrip {

enum ExitCode : int {
  kDone = 0,
  kUsage = 64,          // the command line
  kBadInput = 65,       // an input's content cannot be used at all
  kNoInput = 66,        // an input file is missing or unreadable
  kUnavailable = 69,    // the bus is not available
  kInternal = 70,       // a defect of the program
  kCannotCreate = 73,   // an output could not be created
  kCannotWrite = 74,    // an output could not be written
  kConfiguration = 78,  // the configuration or scenario, or what it names
};

}  // namespace beltgrip
