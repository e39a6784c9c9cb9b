#include "tests/system/vcan/rig.h"

#include <cstdio>
#include <fstream>

namespace beltgrip::test {

std::string program(const std::string& name) { return BELTGRIP_BIN_DIR "/" + name; }

std::string write_rig_config(const std::string& folder, const std::string& interface,
                             const std::string& more) {
  const std::string path = folder + "/" + interface + ".toml";
  std::ofstream(path) << "[bus]\ninterface = \"" << interface
                      << "\"\ndbc = [\"" BELTGRIP_SOURCE_DIR "/tools/scenarios/paper-rig.dbc\"]\n"
                         "[signals]\n"
                         "primary_speed = \"RIG_Speed.PrimarySpeed\"\n"
                         "secondary_speed = \"RIG_Speed.SecondarySpeed\"\n"
                         "secondary_pressure = \"RIG_Pressure.SecondaryPressure\"\n"
                         "primary_torque = \"RIG_Torque.PrimaryTorque\"\n"
                         "[experiment]\n"
                         "trigger = \"always\"\n"
                      << more;
  return path;
}

namespace {

// foreign: frames behind those of each sample, evenly until the next.
void write_second(const std::string& path, int foreign) {
  std::ofstream log(path);
  char stamp[32];
  for (int i = 0; i < 200; ++i) {
    std::snprintf(stamp, sizeof stamp, "(%d.%06d) vcan0 ", i / 200, i * 5000 % 1'000'000);
    // 1000 and 2230 rpm (ratio 2.23), 50 Nm, 4 bar.
    log << stamp << "110#3E808B6000000000\n"
        << stamp << "120#C40900000000\n"
        << stamp << "130#A00FA00F0000\n";
    for (int k = 1; k <= foreign; ++k) {
      std::snprintf(stamp, sizeof stamp, "(%d.%06d) vcan0 ", 0,
                    i * 5000 + k * 5000 / (foreign + 1));
      log << stamp << std::hex << 0x400 + (i * foreign + k) % 64 << std::dec
          << "#0123456789ABCDEF\n";
    }
  }
}

}  // namespace

std::string write_steady_log(const std::string& folder) {
  write_second(folder + "/steady.log", 0);
  return folder + "/steady.log";
}

std::string write_full_log(const std::string& folder) {
  constexpr int kForeign = 17;  // beside the rig's 3: 20 in 5 ms
  write_second(folder + "/full.log", kForeign);
  return folder + "/full.log";
}

std::vector<std::string> canplayer(const std::string& log, const std::string& interface,
                                   bool for_ever) {
  std::vector<std::string> argv{"canplayer", "-I", log};
  if (for_ever) argv.insert(argv.end(), {"-l", "i"});
  argv.push_back(interface + "=vcan0");
  return argv;
}

bool listen(const BusSocket& bus, PublishedFrames& published,
            const std::function<bool(const PublishedFrames&)>& done, Milliseconds limit) {
  return bus
      .receive_until(
          [&](const ReceivedFrame& seen) { return published.take(seen) && done(published); }, limit)
      .has_value();
}

}  // namespace beltgrip::test
