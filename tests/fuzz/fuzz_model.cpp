// Any bytes as a model file: an error in one line, or a model that is the same when it is written
// and read again, and whose numbers are finite.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "daemon/core/config/options/config_model.h"

namespace {

using namespace beltgrip::daemon;

void require(bool condition, int line = __builtin_LINE()) {
  if (condition) return;
  std::fprintf(stderr, "fuzz_model.cpp:%d\n", line);
  std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ModelFile model;
  try {
    model = parse_model({reinterpret_cast<const char*>(data), size}, "m.toml", {});
  } catch (const ModelError& error) {
    require(!error.text.empty() && !error.missing_file);
    return 0;
  }
  for (const auto& [key, value] : model.friction) require(std::isfinite(value));
  for (const auto& [key, value] : model.driveline) require(std::isfinite(value));
  const std::string text = model_text(model);
  try {
    require(model_text(parse_model(text, "again.toml", {})) == text);
  } catch (const ModelError& error) {
    std::fprintf(stderr, "%s\n%s\n", error.text.c_str(), text.c_str());
    std::abort();
  }
  return 0;
}
