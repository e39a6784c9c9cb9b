# cmake -S . -B build-tsan -G Ninja -C tests/presets/tsan.cmake: thread sanitizer.
include(${CMAKE_CURRENT_LIST_DIR}/clang.cmake)
set(BELTGRIP_SANITIZE thread CACHE STRING "" FORCE)
