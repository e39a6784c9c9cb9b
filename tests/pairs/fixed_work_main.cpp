// Fixed work, for callgrind (tests/work): each kind is done once unmeasured, then counted, and
// callgrind dumps its cost under its name. Prints "NAME TIMES": how often the work's unit was done.
#include <valgrind/callgrind.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <functional>
#include <memory>
#include <random>
#include <vector>

#include "can_dbc/dbc/message_codec.h"
#include "can_dbc/dbc/parser.h"
#include "can_dbc/log/can_log.h"
#include "daemon/core/loop/pipeline.h"
#include "tests/loop/closed_loop.h"
#include "tests/loop/recorded_drive.h"
#include "tests/pairs/made_inputs.h"
#include "tests/tools/diagnose/recorded_runs.h"
#include "tools/diagnose/decide/namer.h"
#include "tools/ports/log_timeline.h"
#include "tools/sim/vehicle_scenario.h"
#include "tools/text/short_number.h"

namespace beltgrip::test {

namespace {

constexpr int kFrames = 10'000;

void count(const char* name, long times, const std::function<void()>& work) {
  work();
  CALLGRIND_START_INSTRUMENTATION;
  CALLGRIND_ZERO_STATS;
  work();
  CALLGRIND_DUMP_STATS_AT(name);
  CALLGRIND_STOP_INSTRUMENTATION;
  std::printf("%s %ld\n", name, times);
}

void decode(const char* name, unsigned id, unsigned selectors) {
  const can::DbcParseResult file = can::parse_dbc(plain_dbc());
  const can::MessageCodec codec(*file.database.find_message(can::CanId{id, false}));
  can::DecodedMessage values(codec.signal_count());
  std::mt19937_64 random(1);
  std::vector<std::array<std::uint8_t, 8>> payloads(kFrames);
  for (auto& payload : payloads) {
    for (std::uint8_t& byte : payload) byte = static_cast<std::uint8_t>(random());
    payload[0] = static_cast<std::uint8_t>(payload[0] % selectors);
  }
  count(name, kFrames, [&] {
    for (const auto& payload : payloads) codec.decode(payload, values);
  });
}

void read(const std::string& path) {
  can::LogRecord record;
  const auto log = can::LogReader::open(path);
  while (log->next(record)) {
  }
}

// One frame in five is wanted, as in a replay of a bus with other traffic.
void follow(const std::string& path, bool one_in_five) {
  ports::FrameSelection selection;
  selection.wanted = {{{one_in_five ? 0x100U : 0x7FFU, false}, false}};
  std::vector<std::unique_ptr<can::LogReader>> logs;
  logs.push_back(can::LogReader::open(path));
  ports::LogTimeline timeline(std::move(logs), std::move(selection));
  can::StampedFrame frame;
  while (timeline.next(frame)) {
  }
}

// A coast-down with its experiment: what a replay does but for reading the log.
void drive() {
  const sim::VehicleScenario scenario = sim::shipped_vehicle_scenario("coast-overdrive").scenario;
  const daemon::Config config = vehicle_config(scenario, {});
  const std::vector<DriveStep> steps = record_drive(scenario, config);
  count("drive_step", static_cast<long>(steps.size()), [&] {
    daemon::Pipeline pipeline(config);
    for (const DriveStep& step : steps) {
      daemon::Outbox out;
      if (step.is_frame) {
        pipeline.on_frame(step.frame);
      } else {
        pipeline.on_sample(step.t, out);
      }
    }
  });
}

// A rig without a cause: the fit of the machine, and the search for what is not there.
void diagnose_rig() {
  constexpr int kExperiments = 3;
  blind::Random random(1);
  blind::Trial trial;
  trial.machine = blind::draw_machine(random);
  trial.plan = blind::draw_plan(random, trial.machine.setting, kExperiments);
  const diagnose::Campaign campaign = diagnose::campaign_of(trial);
  long samples = 0;
  for (const diagnose::ExperimentData& run : campaign.runs) samples += run.size();
  count("diagnosis_sample", samples, [&] {
    diagnose::Engine engine(campaign);
    diagnose::name_effects(engine, [] { return false; });
  });
}

void write_numbers() {
  std::array<char, text::kNumberLongest> text;
  for (int i = 0; i < kFrames; ++i) text::write_short(text.data(), i * 0.25 - 40.0, 2);
}

int run() {
  constexpr unsigned kSelectors = 16;
  decode("plain_frame", kPlainId, 256);
  decode("multiplexed_frame", kCasesId, kSelectors);
  const std::string dbc = made_dbc(100);
  count("dbc_byte", static_cast<long>(dbc.size()), [&] { can::parse_dbc(dbc); });
  const Folder folder;
  const std::string log = folder.path("fixed.log");
  write_log(log, kFrames, 0x100, 5);
  count("log_line", kFrames, [&] { read(log); });
  for (const char* kind : {"asc", "trc", "csv"}) {
    const std::string other = folder.path(std::string("fixed.") + kind);
    write_as(log, other);
    count((std::string(kind) + "_line").c_str(), kFrames, [&] { read(other); });
  }
  count("replay_one_in_five", kFrames, [&] { follow(log, true); });
  count("replay_foreign", kFrames, [&] { follow(log, false); });
  count("number_text", kFrames, write_numbers);
  drive();
  diagnose_rig();
  return 0;
}

}  // namespace

}  // namespace beltgrip::test

int main() { return beltgrip::test::run(); }
