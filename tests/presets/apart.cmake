# cmake -S . -B build -G Ninja -C tests/presets/apart.cmake: what changes one source and compiles it again must
# find it alone (tests/mutate, tests/defects). Of these rooms no source is ever changed: they stay in eights.
set(BELTGRIP_TOGETHER "(tests_|tools_|daemon_core_config|daemon_command_line|daemon_io)" CACHE STRING "" FORCE)
