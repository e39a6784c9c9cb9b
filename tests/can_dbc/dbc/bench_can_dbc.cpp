// Speed of loading DBC files, reading candump logs and decoding frames. Not part of the tests:
// ninja bench_can_dbc && BELTGRIP_CORPUS=FOLDER build/tests/bench_can_dbc
// Without the folder, DBC loading is measured on generated text.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>

#include "can_dbc/dbc/message_codec.h"
#include "can_dbc/dbc/message_index.h"
#include "can_dbc/dbc/parser.h"
#include "can_dbc/log/can_log.h"

namespace beltgrip::can {
namespace {

std::string generated_dbc(int messages) {
  std::string text = "VERSION \"\"\nBS_:\nBU_: Engine Gateway\n";
  std::string values;
  for (int i = 0; i < messages; ++i) {
    const std::string id = std::to_string(i);
    text += "BO_ " + id + " Message" + id + ": 8 Engine\n";
    for (int k = 0; k < 8; ++k) {
      text += " SG_ Signal" + std::to_string(k) + " : " + std::to_string(k * 8) +
              "|8@1+ (0.25,-40) [-40|23.75] \"degC\" Gateway\n";
    }
    values += "VAL_ " + id + " Signal0 0 \"off\" 1 \"on\" 2 \"error\" 3 \"not available\" ;\n";
    values += "CM_ SG_ " + id + " Signal1 \"A temperature of the second kind\";\n";
  }
  return text + values;
}

std::vector<std::string> dbc_texts() {
  std::vector<std::string> texts;
  const char* folder = std::getenv("BELTGRIP_CORPUS");
  if (folder == nullptr) return {generated_dbc(1000)};
  for (const auto& entry :
       std::filesystem::directory_iterator(std::filesystem::path(folder) / "dbc")) {
    std::ifstream in(entry.path(), std::ios::binary);
    texts.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  return texts;
}

void load_dbc(benchmark::State& state) {
  const std::vector<std::string> texts = dbc_texts();
  std::int64_t bytes = 0;
  for (auto _ : state) {
    for (const std::string& text : texts) {
      benchmark::DoNotOptimize(parse_dbc(text));
      bytes += static_cast<std::int64_t>(text.size());
    }
  }
  state.SetBytesProcessed(bytes);
}
BENCHMARK(load_dbc)->Unit(benchmark::kMillisecond);

void read_candump(benchmark::State& state) {
  constexpr int kFrames = 1'000'000;
  std::string path = "/tmp/bench_can_dbc_XXXXXX";
  const int descriptor = mkstemp(path.data());
  {
    std::FILE* out = fdopen(descriptor, "wb");
    CandumpWriter writer(out);
    std::mt19937_64 random(1);
    CanFrame frame;
    frame.length = 8;
    for (int i = 0; i < kFrames; ++i) {
      frame.id.value = static_cast<std::uint32_t>(0x100 + random() % 64);
      for (std::size_t k = 0; k < 8; ++k) frame.data[k] = static_cast<std::uint8_t>(random());
      writer.write(1'700'000'000'000'000'000 + std::int64_t{i} * 250'000, "can0", frame);
    }
    std::fclose(out);
  }
  for (auto _ : state) {
    const auto reader = LogReader::open(path);
    LogRecord record;
    while (reader->next(record)) benchmark::DoNotOptimize(record);
  }
  state.SetItemsProcessed(state.iterations() * kFrames);
  unlink(path.c_str());
}
BENCHMARK(read_candump)->Unit(benchmark::kMillisecond);

void decode_frames(benchmark::State& state) {
  const DbcParseResult result = parse_dbc(generated_dbc(64));
  const Database* database = &result.database;
  const MessageIndex index(std::span<const Database* const>(&database, 1));
  std::vector<MessageCodec> codecs;
  for (const MessageDef& message : database->messages) codecs.emplace_back(message);
  std::vector<DecodedSignal> values(8);
  CanFrame frame;
  frame.length = 8;
  std::uint32_t id = 0;
  for (auto _ : state) {
    frame.id.value = id++ % 64;
    frame.data[id % 8] = static_cast<std::uint8_t>(id);
    const MessageIndex::Place* place = index.lookup(frame.id);
    codecs[place->message].decode(frame.payload(), values);
    benchmark::DoNotOptimize(values.data());
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(decode_frames);

}  // namespace
}  // namespace beltgrip::can

BENCHMARK_MAIN();
