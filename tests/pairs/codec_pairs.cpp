#include <algorithm>
#include <array>
#include <memory>
#include <random>
#include <stdexcept>

#include "can_dbc/dbc/message_codec.h"
#include "can_dbc/dbc/parser.h"
#include "tests/pairs/bench_pairs.h"
#include "tests/pairs/plain_decoder.h"
#include "tests/pairs/signal_by_signal.h"

namespace beltgrip::test {

namespace {

constexpr std::size_t kPayloads = 1024;  // that a predictor cannot learn them
constexpr int kRounds = 500;

using Payload = std::array<std::uint8_t, 8>;

std::vector<Payload> payloads(bool with_selector) {
  std::mt19937_64 random(3);
  std::vector<Payload> made(kPayloads);
  for (Payload& payload : made) {
    for (std::uint8_t& byte : payload) byte = static_cast<std::uint8_t>(random());
    if (with_selector) payload[0] = static_cast<std::uint8_t>(payload[0] % PLAIN_CASES);
  }
  return made;
}

struct Coded {
  can::Database dbc;
  can::MessageDef definition;
  can::MessageCodec codec;
  can::DecodedMessage values;
  std::vector<Payload> frames;
  double sum = 0.0;
};

std::shared_ptr<Coded> coded(unsigned id) {
  auto made = std::make_shared<Coded>();
  made->dbc = can::parse_dbc(plain_dbc()).database;
  made->definition = *made->dbc.find_message(can::CanId{id, false});
  made->codec = can::MessageCodec(made->definition);
  made->values = can::DecodedMessage(made->codec.signal_count());
  made->frames = payloads(id == kCasesId);
  return made;
}

// Of the first signal, so that nothing is left out as unused.
Work ours(const std::shared_ptr<Coded>& message) {
  return timed([message] {
    for (int round = 0; round < kRounds; ++round) {
      for (const Payload& payload : message->frames) {
        message->codec.decode(payload, message->values);
        message->sum += message->values[0].physical;
      }
    }
  });
}

// What the generated program's caller has: a number for each signal of the frame.
using Values = std::array<double, 8>;

void plain_decode(const Payload& payload, Values& values) {
  static plain_signals raw;
  if (plain_unpack(&raw, payload.data(), payload.size()) != 0) return;
  values[0] = plain_speed(raw.speed);
  values[1] = plain_torque(raw.torque);
  values[2] = plain_gear(raw.gear);
  values[3] = plain_pressure(raw.pressure);
  values[4] = plain_slope(raw.slope);
  values[5] = plain_mode(raw.mode);
  values[6] = plain_flag(raw.flag);
  values[7] = plain_state(raw.state);
}

void plain_decode_cases(const Payload& payload, Values& values) {
  static plain_cases raw;
  if (plain_unpack_cases(&raw, payload.data(), payload.size()) != 0) return;
  values[0] = plain_selector(raw.selector);
  if (raw.selector >= PLAIN_CASES) return;
  const plain_case& selected = raw.of[raw.selector];
  values[1] = plain_a(selected.a);
  values[2] = plain_b(selected.b);
  values[3] = plain_c(selected.c);
  values[4] = plain_d(selected.d);
  values[5] = plain_e(selected.e);
  values[6] = plain_f(selected.f);
}

Work plain(const std::shared_ptr<Coded>& message, void (*decode)(const Payload&, Values&)) {
  return timed([=] {
    Values values{};
    for (int round = 0; round < kRounds; ++round) {
      for (const Payload& payload : message->frames) {
        decode(payload, values);
        message->sum += values[0];
      }
    }
  });
}

Work signal_by_signal(const std::shared_ptr<Coded>& message) {
  return timed([=, decoder = SignalBySignal(message->definition)] {
    std::vector<double> values(message->definition.signals.size());
    for (int round = 0; round < kRounds; ++round) {
      for (const Payload& payload : message->frames) {
        decoder.decode(payload, values);
        message->sum += values[0];
      }
    }
  });
}

// All decode the same, or the comparison says nothing.
void demand_equal(const Coded& message, std::size_t index, double value) {
  if (message.values[index].physical == value) return;
  throw std::runtime_error(message.definition.signals[index].name + ": decoded differently");
}

void check(Coded& message, void (*decode)(const Payload&, Values&)) {
  Values values{};
  const SignalBySignal decoder(message.definition);
  std::vector<double> by_signal(message.definition.signals.size());
  for (const Payload& payload : message.frames) {
    message.codec.decode(payload, message.values);
    decode(payload, values);
    decoder.decode(payload, by_signal);
    message.values.for_each_present(
        [&](std::size_t signal) { demand_equal(message, signal, by_signal[signal]); });
    demand_equal(message, 0, values[0]);
    const bool cases = message.definition.id.value == kCasesId;
    const std::size_t first = cases ? 1U + payload[0] * 6U : 1U;
    for (std::size_t i = 0; i < (cases ? 6U : 7U); ++i) {
      demand_equal(message, first + i, values[i + 1]);
    }
  }
}

constexpr int kLoaded = 1000;  // messages

void load(const std::string& text) {
  if (can::parse_dbc(text).database.messages.size() != kLoaded) {
    throw std::runtime_error("the DBC: loaded differently");
  }
}

void count_lines(const std::string& text) {
  if (std::count(text.begin(), text.end(), '\n') < kLoaded) {
    throw std::runtime_error("the DBC: lines are missing");
  }
}

}  // namespace

std::vector<Pair> codec_pairs() {
  const auto plain_message = coded(kPlainId);
  const auto cases = coded(kCasesId);
  check(*plain_message, plain_decode);
  check(*cases, plain_decode_cases);
  const std::string dbc = made_dbc(kLoaded);
  constexpr double kFrames = static_cast<double>(kPayloads) * kRounds;
  return {{"decode a plain message", "generated C", kFrames * 8, "signal", ours(plain_message),
           plain(plain_message, plain_decode)},
          {"decode a plain message", "signal by signal", kFrames * 8, "signal", ours(plain_message),
           signal_by_signal(plain_message)},
          {"decode a multiplexed message", "generated C", kFrames, "frame", ours(cases),
           plain(cases, plain_decode_cases)},
          {"decode a multiplexed message", "signal by signal", kFrames, "frame", ours(cases),
           signal_by_signal(cases)},
          {"load a DBC file", "counting its lines", static_cast<double>(dbc.size()), "byte",
           timed([dbc] { load(dbc); }), timed([dbc] { count_lines(dbc); })}};
}

}  // namespace beltgrip::test
