// Any bytes as a configuration: no crash, no hang; what is accepted lies inside every range, what
// is refused says so in lines that name the file.
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "daemon/core/config/load/load_config.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/config/options/config_options.h"

namespace {

using namespace beltgrip::daemon;

constexpr char kDbc[] =
    "VERSION \"\"\nBS_:\nBU_: A\n"
    "BO_ 256 Speeds: 8 A\n SG_ Page M : 56|8@1+ (1,0) [0|0] \"\" A\n"
    " SG_ Primary : 0|16@1+ (0.125,0) [0|8000] \"rpm\" A\n"
    " SG_ Secondary m1 : 16|16@1+ (0.125,0) [0|8000] \"rpm\" A\n"
    "BO_ 257 Rest: 8 A\n SG_ Pressure : 7|16@0+ (0.001,0) [0|60] \"bar\" A\n"
    " SG_ Torque : 16|16@1- (0.1,0) [-500|500] \"Nm\" A\n SG_ Flag : 32|1@1+ (1,0) [0|1] \"\" A\n";

void require(bool condition, int line = __builtin_LINE()) {
  if (condition) return;
  std::fprintf(stderr, "fuzz_config.cpp:%d\n", line);
  std::abort();
}

void write_file(const std::string& path, const void* data, std::size_t size) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  require(file != nullptr && std::fwrite(data, 1, size, file) == size);
  std::fclose(file);
}

const std::string& directory() {
  static const std::string path = [] {
    std::string name = (std::filesystem::temp_directory_path() / "fuzz_config.XXXXXX").string();
    require(mkdtemp(name.data()) != nullptr);
    write_file(name + "/a.dbc", kDbc, sizeof kDbc - 1);
    static const std::string kept = name;
    std::atexit([] { std::filesystem::remove_all(kept); });
    return name;
  }();
  return path;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string path = directory() + "/c.toml";
  write_file(path, data, size);
  ConfigResult result = load_config(path);
  require(result.config.has_value() == result.errors.empty());
  for (const ConfigError& error : result.errors) {
    require(error.text.starts_with(path) && error.text.find('\n') == std::string::npos);
    require(error.exit_code == 78 || error.exit_code == 66 || error.exit_code == 65);
  }
  if (!result.config) return 0;
  for (const Option& option : option_table()) {
    if (option.kind != Option::Kind::kNumber) continue;
    const double value = option.number(*result.config) / option.factor;
    require(value >= option.minimum * (1 - 1e-12) - 1e-12 &&
            value <= option.maximum * (1 + 1e-12) + 1e-12);
  }
  require(result.config->roles.size() >= 4);
  return 0;
}
