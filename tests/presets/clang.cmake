# What both builds with sanitizers have in common. Frames and lines in a report; no build type: its
# flags would come behind these.
set(CMAKE_BUILD_TYPE None CACHE STRING "" FORCE)
set(CMAKE_CXX_FLAGS "-O2 -gline-tables-only" CACHE STRING "" FORCE)
set(CMAKE_C_COMPILER clang-19 CACHE STRING "" FORCE)
set(CMAKE_CXX_COMPILER clang++-19 CACHE STRING "" FORCE)
set(BELTGRIP_TESTS ON CACHE BOOL "" FORCE)
