# cmake -S . -B build -G Ninja -C tests/presets/release.cmake: as it is installed, with the tests.
set(CMAKE_BUILD_TYPE Release CACHE STRING "" FORCE)
set(BELTGRIP_TESTS ON CACHE BOOL "" FORCE)
