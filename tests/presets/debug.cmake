# cmake -S . -B build-debug -G Ninja -C tests/presets/debug.cmake: to step through.
set(CMAKE_BUILD_TYPE Debug CACHE STRING "" FORCE)
set(BELTGRIP_TESTS ON CACHE BOOL "" FORCE)
