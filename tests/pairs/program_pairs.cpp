#include "can_dbc/log/can_log.h"
#include "tests/pairs/bench_pairs.h"

namespace beltgrip::test {

namespace {

constexpr int kDecoded = 500'000;
constexpr int kFewMessages = 100;
constexpr int kManyMessages = 10'000;
constexpr int kForeignAlone = 4'000'000;  // so many that the program's start is a small part
constexpr int kLarge = 33'000;            // a DBC of some 22 MB
constexpr int kForeign = 4;  // beside each frame of the vehicle: one in five is decoded

double frames_of(const std::string& path) {
  const auto reader = can::LogReader::open(path);
  can::LogRecord record;
  double frames = 0.0;
  while (reader->next(record)) ++frames;
  return frames;
}

}  // namespace

std::vector<Pair> program_pairs(const Folder& folder, const std::string& beltgrip,
                                const std::string& other) {
  std::vector<Pair> pairs;
  // Beside reading the log and nothing else; beside the other program where there is one.
  const auto add = [&](const std::string& name, const std::string& log,
                       const std::vector<std::string>& arguments) {
    const auto of = [&](const std::string& path) {
      std::vector<std::string> argv{path};
      argv.insert(argv.end(), arguments.begin(), arguments.end());
      return program(argv);
    };
    const double frames = frames_of(log);
    pairs.push_back(
        {name, "reading the log", frames, "frame", of(beltgrip), timed([log] { frames_of(log); })});
    if (!other.empty()) pairs.push_back({name, other, frames, "frame", of(beltgrip), of(other)});
  };

  const std::string few = folder.path("few.dbc");
  const std::string many = folder.path("many.dbc");
  const std::string few_log = folder.path("few.log");
  const std::string many_log = folder.path("many.log");
  write_text(few, made_dbc(kFewMessages));
  write_text(many, made_dbc(kManyMessages));
  write_log(few_log, kDecoded, 0, kFewMessages);
  write_log(many_log, kDecoded, 0, kManyMessages);
  add("dbc decode to JSON, 100 messages", few_log,
      {"dbc", "decode", "--dbc", few, few_log, "--json", "/dev/null"});
  add("dbc decode to JSON, 10,000 messages", many_log,
      {"dbc", "decode", "--dbc", many, many_log, "--json", "/dev/null"});
  const std::string asc = folder.path("few.asc"), trc = folder.path("few.trc"),
                    csv = folder.path("few.csv");
  for (const std::string& path : {asc, trc, csv}) {
    write_as(few_log, path);
    add("dbc decode of " + path.substr(path.size() - 4) + " to JSON, one signal", path,
        {"dbc", "decode", "--dbc", few, path, "--signals", "Message7.Signal1", "--json",
         "/dev/null"});
  }
  const std::string large = folder.path("large.dbc");
  const std::string large_text = made_dbc(kLarge);
  write_text(large, large_text);
  if (!other.empty()) {
    pairs.push_back({"dbc check of a large DBC", other, static_cast<double>(large_text.size()),
                     "byte", program({beltgrip, "dbc", "check", large}),
                     program({other, "dbc", "check", large})});
  }
  add("dbc decode to CSV, 100 messages", few_log,
      {"dbc", "decode", "--dbc", few, few_log, "--csv", "/dev/null"});

  if (!other.empty()) {
    constexpr double kCity_s = 600;
    const auto city = [](const std::string& path) {
      return program(
          {path, "simulate", "--scenario", "city", "--duration", "600", "--json", "/dev/null"});
    };
    pairs.push_back(
        {"closed loop in the city", other, kCity_s, "second", city(beltgrip), city(other)});
  }
  const std::string drive = folder.path("drive");
  program({beltgrip, "simulate", "--set", "run.cycles=8", "--out-dir", drive})();
  const std::string trace = drive + "/trace.log";
  const std::string configuration = drive + "/beltgrip.toml";
  const std::string diluted = folder.path("diluted.log");
  write_diluted(trace, diluted, kForeign);
  const std::string foreign = folder.path("foreign.log");
  write_log(foreign, kForeignAlone, 0x400, 64);
  add("replay of the vehicle's own frames", trace, {"replay", trace, "--config", configuration});
  add("replay with one frame in five decoded", diluted,
      {"replay", diluted, "--config", configuration});
  add("replay of foreign traffic", foreign, {"replay", foreign, "--config", configuration});
  return pairs;
}

}  // namespace beltgrip::test
