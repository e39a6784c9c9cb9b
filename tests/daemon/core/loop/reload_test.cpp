// A configuration that is read again while the daemon runs: in force between two samples, never in
// an experiment, nothing lost, nothing allocated by the loop; and refused when anything is wrong.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <map>

#include "can_dbc/dbc/signal_codec.h"
#include "daemon/core/config/load/load_config.h"
#include "daemon/core/publish/own_frames.h"
#include "daemon/io/history_keeper.h"
#include "daemon/io/reloader.h"
#include "tests/daemon/frame_player.h"
#include "tests/daemon/test_vehicle.h"
#include "tests/support/alloc_guard.h"

namespace beltgrip::daemon {
namespace {

constexpr std::uint32_t kOtherSlip = 0x6B1;

std::string toml(const std::string& trigger, const std::string& more = "") {
  std::string text = test::kVehicleToml;
  text.replace(text.find("\"always\""), 8, '"' + trigger + '"');
  return text + more;
}

std::string other_identifiers() {
  std::string text = toml("signal");
  text.insert(text.find("[signals]"), "identifiers = { slip = 0x6B1 }\n");
  return text;
}

std::unique_ptr<Reload> reload_of(const Config& config, bool keeps_results = true) {
  return std::unique_ptr<Reload>(
      new Reload{config, wanted_frames(config), keeps_results, Pipeline(config)});
}

// The helper thread's part, and a look at each sample: `act` may offer and collect.
class Helper final : public SampleSink {
 public:
  Helper(SampleSink& next, std::function<void(const SampleReport&)> act)
      : next_(next), act_(std::move(act)) {}
  void on_report(const SampleReport& report) noexcept override {
    act_(report);
    next_.on_report(report);
  }

 private:
  SampleSink& next_;
  std::function<void(const SampleReport&)> act_;
};

struct Played {
  std::vector<test::SentFrame> sent;
  std::vector<SampleReport> reports;
  std::vector<ExperimentResult> results;
  PipelineCounters counters;
};

Played run_with(const Config& config, std::vector<can::StampedFrame> frames, ReloadSlot& slot,
                const std::function<void(const SampleReport&)>& act) {
  test::FramePlayer port(std::move(frames));
  test::ReportKeeper keeper;
  Pipeline pipeline(config);
  Helper helper(keeper, act);
  run_loop(port, pipeline, config.estimator.sample_rate_hz, estimator::StopReason::kTraceEnd,
           &helper, nullptr, nullptr, {.reload = &slot});
  return {port.sent, keeper.reports, keeper.results, pipeline.counters()};
}

std::vector<can::StampedFrame> drive(std::uint32_t from_ms, std::uint32_t to_ms) {
  test::Drive wanted;
  wanted.active_from_ms = from_ms;
  wanted.active_to_ms = to_ms;
  return test::drive_frames(wanted);
}

// The counter of each message's frames, in the order in which they were sent.
void expect_counters_go_on(const std::vector<test::SentFrame>& sent) {
  std::map<std::uint8_t, int> last;
  for (const test::SentFrame& each : sent) {
    const std::uint32_t id =
        each.frame.id.value == kOtherSlip ? std::uint32_t{0x6A1} : each.frame.id.value;
    const int counter = each.frame.data[1] & 0x0F;
    const auto [before, first] = last.try_emplace(static_cast<std::uint8_t>(id & 0xF), counter);
    if (!first) {
      EXPECT_EQ(counter, (before->second + 1) % 15) << id;
    }
    before->second = counter;
  }
}

TEST(Reload, IsInForceAtTheNextSampleAndCountersGoOn) {
  const Config before = test::vehicle_config(toml("signal"));
  const Config after = test::vehicle_config(other_identifiers());
  ReloadSlot slot;
  MonoTime offered{};
  int collected = 0;
  const Played run = run_with(before, drive(0, 0), slot, [&](const SampleReport& report) {
    if (offered == MonoTime{} && report.t >= MonoTime{3 * kSecond}) {
      EXPECT_EQ(slot.offer(reload_of(after)), nullptr);
      offered = report.t;
    }
    if (const auto back = slot.collect()) {
      ++collected;
      EXPECT_EQ(back->config.identifiers.slip, kOtherSlip);
    }
  });
  EXPECT_EQ(collected, 1);
  for (const test::SentFrame& each : run.sent) {
    if (each.frame.id.value == kOtherSlip) {
      EXPECT_GT(each.t, offered);
    } else if (each.frame.id.value == 0x6A1) {
      EXPECT_LE(each.t, offered);
    }
  }
  EXPECT_TRUE(std::any_of(run.sent.begin(), run.sent.end(),
                          [](const auto& each) { return each.frame.id.value == kOtherSlip; }));
  expect_counters_go_on(run.sent);
  EXPECT_EQ(run.counters.samples + 1, run.reports.size()) << "and one at the end";
  // Inputs that go on coming are not missed for a moment.
  for (const SampleReport& report : run.reports) {
    EXPECT_EQ(report.faults, 0U) << report.t;
  }
}

TEST(Reload, WaitsForTheEndOfAnExperimentAndItsResultStands) {
  const Config before = test::vehicle_config(toml("signal"));
  const Config after = test::vehicle_config(other_identifiers());
  ReloadSlot slot;
  bool offered = false;
  MonoTime in_force{};
  const Played run = run_with(before, drive(1000, 9500), slot, [&](const SampleReport& report) {
    if (!offered && report.in_experiment && report.t >= MonoTime{4 * kSecond}) {
      slot.offer(reload_of(after));
      offered = true;
    }
    if (slot.collect() != nullptr) in_force = report.t;
  });
  ASSERT_TRUE(offered);
  ASSERT_EQ(run.results.size(), 1U);
  EXPECT_EQ(run.results[0].outcome, Outcome::kCompleted);
  ASSERT_NE(in_force, MonoTime{});
  MonoTime over{};
  for (const SampleReport& report : run.reports) {
    if (report.in_experiment) over = report.t;
  }
  EXPECT_GT(in_force, over);
  // The value of before is published under the new identifiers' configuration as well.
  EXPECT_EQ(run.reports.back().result.peak.mu_max, run.results[0].peak.mu_max);
  EXPECT_EQ(run.sent.back().frame.id.value & 0xFF0U, 0x6A0U);
}

TEST(Reload, OfAnotherVariatorForgetsTheValueAndKeepsTheCount) {
  const Config before = test::vehicle_config(toml("signal"));
  const Config after =
      test::vehicle_config(toml("signal", "[variator]\nsecondary_piston_area_m2 = 0.012\n"));
  ReloadSlot slot;
  bool offered = false;
  const Played run = run_with(before, drive(1000, 9500), slot, [&](const SampleReport& report) {
    if (!offered && report.in_experiment) {
      slot.offer(reload_of(after, false));
      offered = true;
    }
    slot.collect();
  });
  ASSERT_EQ(run.results.size(), 1U);
  EXPECT_EQ(run.reports.back().result.outcome, Outcome::kNone);
  const auto estimate = std::find_if(run.sent.rbegin(), run.sent.rend(),
                                     [](const auto& each) { return each.frame.id.value == 0x6A0; });
  const auto value = [&](const char* signal) {
    const can::MessageDef* message = own_database().find_message(estimate->frame.id);
    return can::SignalCodec(*message->find_signal(signal)).decode(estimate->frame.payload());
  };
  EXPECT_EQ(value("MuMaxValid"), 0.0);
  EXPECT_EQ(value("ExperimentCount"), 1.0);
}

TEST(Reload, AForeignSenderStaysAFault) {
  const Config config = test::vehicle_config(toml("signal"));
  std::vector<can::StampedFrame> frames = drive(0, 0);
  can::CanFrame foreign;
  foreign.id = {0x6A1, false};
  foreign.length = 8;
  // Just before the reload; ten seconds later it is forgotten.
  const auto at = std::find_if(frames.begin(), frames.end(), [](const can::StampedFrame& each) {
    return each.t_ns > (3 * kSecond - 100 * kMillisecond).ns();
  });
  frames.insert(at, {at->t_ns, foreign});
  ReloadSlot slot;
  bool offered = false;
  int reloads = 0;
  const Played run = run_with(config, frames, slot, [&](const SampleReport& report) {
    if (report.t >= MonoTime{3 * kSecond} && !offered) {
      slot.offer(reload_of(config));
      offered = true;
    }
    if (slot.collect() != nullptr) ++reloads;
  });
  EXPECT_EQ(reloads, 1);
  const auto after =
      std::find_if(run.reports.begin(), run.reports.end(),
                   [](const SampleReport& each) { return each.t > MonoTime{8 * kSecond}; });
  ASSERT_NE(after, run.reports.end());
  EXPECT_NE(after->faults & fault_bit(Fault::kForeignSender), 0U);
}

// A hundred in a row, and one that comes before another was taken: no allocation on the loop's
// thread, which is guarded but for what this test does in the helper's place.
TEST(Reload, AHundredOfThemAllocateNothingOnTheLoopsThread) {
  const Config config = test::vehicle_config(toml("signal"));
  std::vector<std::unique_ptr<Reload>> ready;
  for (int i = 0; i < 101; ++i) ready.push_back(reload_of(config));
  std::vector<std::unique_ptr<Reload>> used(ready.size() + 1);
  class Sink final : public SampleSink {
   public:
    Sink(SampleSink& next, ReloadSlot& slot, std::vector<std::unique_ptr<Reload>>& ready,
         std::vector<std::unique_ptr<Reload>>& used)
        : next_(next), slot_(slot), ready_(ready), used_(used) {}
    void on_report(const SampleReport& report) noexcept override {
      next_.on_report(report);
      if (auto back = slot_.collect()) used_[taken++] = std::move(back);
      if (offered == ready_.size() || report.t < MonoTime{2 * kSecond}) return;
      auto before = slot_.offer(std::move(ready_[offered++]));
      if (before != nullptr) used_[used_.size() - 1] = std::move(before);
    }
    std::size_t taken = 0, offered = 0;

   private:
    SampleSink& next_;
    ReloadSlot& slot_;
    std::vector<std::unique_ptr<Reload>>& ready_;
    std::vector<std::unique_ptr<Reload>>& used_;
  };
  class Nothing final : public SampleSink {
   public:
    void on_report(const SampleReport&) noexcept override {}
  };
  class Quiet final : public Port {  // frames in, nothing kept of those out
   public:
    explicit Quiet(std::vector<can::StampedFrame> frames) : player_(std::move(frames)) {
      player_.sent.reserve(10000);
    }
    MonoTime now() noexcept override { return player_.now(); }
    Wake wait_until(MonoTime t) noexcept override { return player_.wait_until(t); }
    std::size_t receive(std::span<RxFrame> out) noexcept override { return player_.receive(out); }
    SendResult send(const can::CanFrame&) noexcept override { return SendResult::kSent; }
    BusState bus_state() noexcept override { return BusState::kActive; }

   private:
    test::FramePlayer player_;
  };
  Quiet port(drive(0, 0));
  Pipeline pipeline(config);
  ReloadSlot slot;
  Nothing nothing;
  Sink sink(nothing, slot, ready, used);
  {
    const test::AllocGuard guard;
    run_loop(port, pipeline, config.estimator.sample_rate_hz, estimator::StopReason::kTraceEnd,
             &sink, nullptr, nullptr, {.reload = &slot});
    EXPECT_EQ(test::AllocGuard::allocations(), 0U);
    EXPECT_EQ(test::AllocGuard::frees(), 0U);
  }
  EXPECT_EQ(sink.taken, 101U);
}

// --- reading it again ------------------------------------------------------------------------

class Reading : public testing::Test {
 protected:
  Reading() {
    directory_.write("vehicle.dbc", test::kVehicleDbc);
    write(toml("signal"));
  }
  void write(const std::string& text) { path_ = directory_.write("beltgripd.toml", text); }
  Reloader reloader() {
    return Reloader(path_, *load_config(path_).config, slot_, claim_.get(),
                    [this](bool warning, const std::string& line) {
                      (warning ? warnings_ : infos_).push_back(line);
                    });
  }
  // What the loop would do.
  void take() {
    Reload* taken = slot_.take();
    ASSERT_NE(taken, nullptr);
    slot_.give_back(taken);
  }

  test::TemporaryDirectory directory_;
  std::string path_;
  ReloadSlot slot_;
  std::unique_ptr<BusClaim> claim_;
  std::vector<std::string> warnings_, infos_;
};

TEST_F(Reading, WhatIsRightIsOfferedAndThenInForce) {
  Reloader reloader = this->reloader();
  write(other_identifiers());
  EXPECT_TRUE(reloader.request());
  EXPECT_TRUE(reloader.waiting());
  EXPECT_FALSE(reloader.turn());
  EXPECT_EQ(reloader.running().identifiers.slip, 0x6A1U);
  take();
  EXPECT_TRUE(reloader.turn());
  EXPECT_FALSE(reloader.waiting());
  EXPECT_EQ(reloader.running().identifiers.slip, kOtherSlip);
  EXPECT_EQ(warnings_, std::vector<std::string>{});
  EXPECT_EQ(infos_.back(), "reload: " + path_ + " is in force");
}

TEST_F(Reading, ANewerOneTakesThePlaceOfOneThatWaits) {
  Reloader reloader = this->reloader();
  write(other_identifiers());
  EXPECT_TRUE(reloader.request());
  write(toml("signal"));
  EXPECT_TRUE(reloader.request());
  take();
  EXPECT_EQ(slot_.take(), nullptr);
  EXPECT_TRUE(reloader.turn());
  EXPECT_EQ(reloader.running().identifiers.slip, 0x6A1U);
}

// The one that waits is taken while the next is being read: that one is held against the one that
// is in force by then, and goes on waiting.
TEST_F(Reading, OneThatIsTakenWhileTheNextIsReadIsTheOneThatIsReplaced) {
  Reloader reloader = this->reloader();
  write(toml("signal", "[variator]\nsecondary_piston_area_m2 = 0.012\n"));
  ASSERT_TRUE(reloader.request());
  take();
  for (int i = 0; i < 2; ++i) {  // and one more, as the helper thread has its hands full
    write(i == 0 ? toml("always") : other_identifiers());  // of the first one's belt
    ASSERT_TRUE(reloader.request());
    EXPECT_EQ(slot_.take(), nullptr);
  }
  EXPECT_TRUE(reloader.turn());
  EXPECT_TRUE(reloader.waiting());
  EXPECT_EQ(reloader.running().identifiers.slip, 0x6A1U);
  Reload* next = slot_.take();
  ASSERT_NE(next, nullptr);
  EXPECT_EQ(next->config.identifiers.slip, kOtherSlip);
  EXPECT_FALSE(next->keeps_results);
  slot_.give_back(next);
  EXPECT_TRUE(reloader.turn());
  EXPECT_FALSE(reloader.waiting());
  EXPECT_EQ(reloader.running().identifiers.slip, kOtherSlip);
  EXPECT_FALSE(reloader.turn());
}

struct Wrong {
  const char* name;
  std::string from, to;  // in the file
  std::string said;
};
class WrongConfiguration : public Reading, public testing::WithParamInterface<Wrong> {};

TEST_P(WrongConfiguration, IsRefusedWithOneLine) {
  Reloader reloader = this->reloader();
  std::string text = toml("signal");
  if (GetParam().from.empty()) {
    std::filesystem::remove(path_);
  } else {
    text.replace(text.find(GetParam().from), GetParam().from.size(), GetParam().to);
    write(text);
  }
  EXPECT_FALSE(reloader.request());
  EXPECT_FALSE(reloader.waiting());
  EXPECT_EQ(slot_.take(), nullptr);
  ASSERT_EQ(warnings_.size(), 1U);
  EXPECT_TRUE(warnings_[0].starts_with("reload refused, the old configuration stays: " + path_))
      << warnings_[0];
  EXPECT_NE(warnings_[0].find(GetParam().said), std::string::npos) << warnings_[0];
  EXPECT_EQ(warnings_[0].find('\n'), std::string::npos);
}

INSTANTIATE_TEST_SUITE_P(
    , WrongConfiguration,
    testing::Values(
        Wrong{"Missing", "", "", "beltgripd.toml"},
        Wrong{"NoToml", "[experiment]", "[experiment", ":10: syntax"},
        Wrong{"UnknownKey", "[experiment]", "[experiment]\nno_such_key = 1", "no_such_key"},
        Wrong{"TwoErrors", "[experiment]", "[experiment]\nno_such_key = 1\nnor_this = 2",
              "(and 1 more)"},
        Wrong{"NoSuchSignal", "Speeds.PrimarySpeed", "Speeds.Nothing", "primary_speed"},
        Wrong{"NoSuchDbc", "vehicle.dbc", "gone.dbc", "gone.dbc"},
        Wrong{"Interface", "inproc:test", "inproc:other",
              "bus.interface: found \"inproc:other\", expected \"inproc:test\" (only a restart"},
        Wrong{"SampleRate", "[experiment]", "[estimator]\nsample_rate_hz = 100\n[experiment]",
              "estimator.sample_rate_hz: found 100, expected 200 (only a restart"},
        Wrong{"StateDir", "[experiment]", "[daemon]\nstate_dir = \"x\"\n[experiment]",
              "daemon.state_dir"}),
    [](const auto& test) { return test.param.name; });

// --- identifiers that another daemon has --------------------------------------------------------

class Claiming : public Reading {
 protected:
  // No interface has this name: claims are among processes.
  Claiming() : bus_("reload-" + std::to_string(getpid())) {
    claim_ = std::make_unique<BusClaim>(bus_, FrameIdentifiers{});
  }
  bool is_free(const FrameIdentifiers& identifiers) const {
    return BusClaim(bus_, identifiers).refused().empty();
  }
  std::string bus_;
  const FrameIdentifiers others_{0x6B0, kOtherSlip, 0x6B2, 0x6B3};
};

TEST_F(Claiming, IdentifiersOfAnotherDaemonAreRefusedAsAWhole) {
  Reloader reloader = this->reloader();
  std::string wanted = other_identifiers();
  const std::string slip = "slip = 0x6B1";
  wanted.replace(wanted.find(slip), slip.size(), "estimate = 0x6C0, " + slip);
  write(wanted);
  {
    const BusClaim other(bus_, others_);
    EXPECT_FALSE(reloader.request());
    EXPECT_FALSE(reloader.waiting());
    EXPECT_EQ(slot_.take(), nullptr);
    ASSERT_EQ(warnings_.size(), 1U);
    EXPECT_EQ(warnings_[0], "reload refused, the old configuration stays: " + path_ +
                                ": another beltgripd on this host publishes 0x6B1 on " + bus_ +
                                "; stop it, or give one of them other [bus] identifiers");
    EXPECT_EQ(reloader.running().identifiers.slip, 0x6A1U);
    // Nothing of it is kept, and what was held is held.
    EXPECT_TRUE(is_free({0x6C0, 0x6C1, 0x6C2, 0x6C3}));
    EXPECT_FALSE(is_free({0x6C0, 0x6A1, 0x6C2, 0x6C3}));
  }
  EXPECT_TRUE(reloader.request()) << "the other has gone";
}

TEST_F(Claiming, BothSetsAreHeldUntilItIsInForce) {
  Reloader reloader = this->reloader();
  write(other_identifiers());
  ASSERT_TRUE(reloader.request());
  EXPECT_FALSE(is_free({0x6C0, 0x6A1, 0x6C2, 0x6C3}));
  EXPECT_FALSE(is_free({0x6C0, kOtherSlip, 0x6C2, 0x6C3}));
  take();
  ASSERT_TRUE(reloader.turn());
  EXPECT_TRUE(is_free({0x6C0, 0x6A1, 0x6C2, 0x6C3}));
  EXPECT_FALSE(is_free({0x6C0, kOtherSlip, 0x6C2, 0x6C3}));
}

TEST_F(Claiming, IdentifiersOfTheNextAreHeldWhileTheOneBeforeComesInForce) {
  Reloader reloader = this->reloader();
  ASSERT_TRUE(reloader.request());
  take();
  write(other_identifiers());
  ASSERT_TRUE(reloader.request());
  ASSERT_TRUE(reloader.turn());
  EXPECT_FALSE(is_free({0x6C0, kOtherSlip, 0x6C2, 0x6C3}));
  take();
  EXPECT_FALSE(is_free({0x6C0, 0x6A1, 0x6C2, 0x6C3}));
  ASSERT_TRUE(reloader.turn());
  EXPECT_TRUE(is_free({0x6C0, 0x6A1, 0x6C2, 0x6C3}));
  EXPECT_FALSE(is_free({0x6C0, kOtherSlip, 0x6C2, 0x6C3}));
}

// --- files that never end -----------------------------------------------------------------------

class NoRegularFile : public Reading, public testing::WithParamInterface<const char*> {
 protected:
  // In the place of the file: a pipe that nobody writes to, a directory, a device without end.
  void replace(const std::string& name) {
    const std::string path = directory_.path() + "/" + name;
    std::filesystem::remove(path);
    const std::string kind = GetParam();
    if (kind == "Pipe") {
      ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
    } else if (kind == "Directory") {
      std::filesystem::create_directory(path);
    } else {
      std::filesystem::create_symlink("/dev/zero", path);
    }
  }
};

TEST_P(NoRegularFile, IsRefusedWhereverItStandsAndTheNextGoodOneIsTaken) {
  directory_.write("more.toml", "");
  directory_.write("model.toml", "");
  const std::string all =
      "include = [\"more.toml\"]\n" + toml("signal") + "[estimator]\nmodel = \"model.toml\"\n";
  write(all);
  Reloader reloader = this->reloader();
  for (const char* name : {"beltgripd.toml", "more.toml", "vehicle.dbc", "model.toml"}) {
    SCOPED_TRACE(name);
    const std::string path = directory_.path() + "/" + name;
    std::filesystem::rename(path, path + ".kept");
    replace(name);
    warnings_.clear();
    EXPECT_FALSE(reloader.request());
    ASSERT_EQ(warnings_.size(), 1U);
    EXPECT_NE(warnings_[0].find(name), std::string::npos) << warnings_[0];
    EXPECT_NE(warnings_[0].find(GetParam() == std::string("Directory") ? "it is a directory"
                                                                       : "it is no regular file"),
              std::string::npos)
        << warnings_[0];
    std::filesystem::remove(path);
    std::filesystem::rename(path + ".kept", path);
  }
  EXPECT_TRUE(reloader.request());
}

INSTANTIATE_TEST_SUITE_P(, NoRegularFile, testing::Values("Pipe", "Directory", "Device"),
                         [](const auto& test) { return std::string(test.param); });

// Each configuration has its own history.
TEST(History, OfTheConfigurationThatIsInForceCounts) {
  const test::TemporaryDirectory folder;
  HistoryKeeper keeper(
      folder.path(), "one", [](bool, const std::string&) {}, [] { return 1e9; });
  keeper.open();
  ExperimentResult result;
  result.outcome = Outcome::kCompleted;
  result.peak.kind = estimator::PeakKind::kValue;
  result.peak.mu_max = 0.1;
  result.peak.mu_max_std = 0.001;
  result.peak.ci95_low = 0.098;
  result.peak.ci95_high = 0.102;
  result.torque_Nm = 50.0;
  const auto known = [](const estimator::LearnedFriction& learned) {
    return std::any_of(learned.groups.begin(), learned.groups.end(),
                       [](const auto& group) { return group.known; });
  };
  EXPECT_TRUE(known(keeper.take(result)));
  EXPECT_FALSE(known(keeper.change_fingerprint("two")));
  EXPECT_TRUE(known(keeper.change_fingerprint("one")));
}

}  // namespace
}  // namespace beltgrip::daemon
