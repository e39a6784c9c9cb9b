# cmake -S . -B build-clang -G Ninja -C tests/presets/asan.cmake: address and undefined-behaviour
# sanitizers, with the fuzzers.
include(${CMAKE_CURRENT_LIST_DIR}/clang.cmake)
set(BELTGRIP_SANITIZE address,undefined CACHE STRING "" FORCE)
set(CMAKE_CXX_FLAGS "${CMAKE_CXX_FLAGS} -fsanitize-ignorelist=${CMAKE_CURRENT_LIST_DIR}/not_ours.txt"
    CACHE STRING "" FORCE)
set(BELTGRIP_FUZZ ON CACHE BOOL "" FORCE)
set(BELTGRIP_PRECOMPILED ON CACHE BOOL "" FORCE)
set(BELTGRIP_TOGETHER "" CACHE STRING "" FORCE)
