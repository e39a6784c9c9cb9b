// rounds --trials N [--from S] [--rounds R]: hidden causes that a first diagnosis leaves open, and
// how many are found after one recommended experiment, two, ...; beside it as many drawn ones.
#include <charconv>
#include <cstdio>
#include <cstring>
#include <string>

#include "tests/statistics/blind/rounds.h"

namespace {

using namespace beltgrip::blind;

const char* words(Standing standing) {
  switch (standing) {
    case Standing::kAlone:
      return "alone";
    case Standing::kInClass:
      return "in class";
    case Standing::kUnseen:
      return "unseen";
    case Standing::kSilent:
      return "silent";
    case Standing::kWrong:
      break;
  }
  return "wrong";
}

const char* plan_words(const Trial& trial) {
  const PlannedRun &first = trial.plan[0], &second = trial.plan[1];
  return first.speed_rad_s != second.speed_rad_s ? "speeds"
         : first.torque_Nm != second.torque_Nm   ? "torques"
                                                 : "equal";
}

}  // namespace

int main(int argc, char** argv) {
  std::uint64_t trials = 0, from = 1;
  int rounds = 2;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i];
    const char* value = argv[i + 1];
    const char* end = value + std::strlen(value);
    if (name == "--trials") std::from_chars(value, end, trials);
    if (name == "--from") std::from_chars(value, end, from);
    if (name == "--rounds") std::from_chars(value, end, rounds);
  }
  if (trials == 0) {
    std::fprintf(stderr, "usage: rounds --trials N [--from S] [--rounds R]\n");
    return 64;
  }
  for (std::uint64_t i = 0; i < trials; ++i) {
    const RoundsOfTrial played = play(from + i, rounds);
    const Planted& planted = played.trial.planted.front();
    std::printf("%llu %s %s %s %.1f %s", static_cast<unsigned long long>(played.number),
                planted.effect.c_str(), planted.parameters.begin()->first.c_str(),
                plan_words(played.trial), played.sigmas, words(played.first.standing));
    const auto show = [](const Round& each) {
      std::printf(" -> %s (%s)", words(each.standing), each.answer.c_str());
    };
    std::printf(" (%s) | followed", played.first.answer.c_str());
    for (const Round& each : played.followed) show(each);
    std::printf(" | drawn");
    for (const Round& each : played.random) show(each);
    std::printf(" | %s\n", played.first.next_why.c_str());
    std::fflush(stdout);
  }
  return 0;
}
