// What people and scripts read: JSON text, exact seconds, BeltGrip's frames as table and as
// verdict.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <nlohmann/json.hpp>

#include "daemon/core/publish/own_frames.h"
#include "tools/cli/replay_run.h"
#include "tools/cli/verdict.h"
#include "tools/monitor/own_frame_view.h"
#include "tools/text/json_writer.h"
#include "tools/text/seconds.h"
#include "tools/text/snake_case.h"

namespace beltgrip::cli {
namespace {

TEST(JsonWriter, WritesWhatAParserReadsBack) {
  text::JsonWriter json;
  json.begin_object()
      .field("text", "a\"b\\c\n\x01\x7f µ")
      .field("number", 0.1)
      .field("third", 1.0 / 3.0)
      .field("big", std::numeric_limits<std::uint64_t>::max())
      .field("nan", std::nan(""))
      .field("inf", -std::numeric_limits<double>::infinity())
      .field("yes", true)
      .key("list")
      .begin_array()
      .value(1)
      .null()
      .begin_object()
      .end_object()
      .begin_array()
      .end_array()
      .value("x")
      .end_array()
      .end_object();
  EXPECT_NE(json.text().find("\"number\":0.1,"), std::string::npos);
  const auto read = nlohmann::json::parse(json.take());
  EXPECT_EQ(read.at("text"), "a\"b\\c\n\x01\x7f µ");
  EXPECT_EQ(read.at("third").get<double>(), 1.0 / 3.0);
  EXPECT_EQ(read.at("big").get<std::uint64_t>(), std::numeric_limits<std::uint64_t>::max());
  EXPECT_TRUE(read.at("nan").is_null());
  EXPECT_TRUE(read.at("inf").is_null());
  EXPECT_EQ(read.at("yes"), true);
  EXPECT_EQ(read.at("list"), nlohmann::json::parse("[1,null,{},[],\"x\"]"));
  EXPECT_EQ(json.begin_array().end_array().take(), "[]");
}

TEST(Seconds, AreExact) {
  EXPECT_EQ(text::seconds_text(0), "0");
  EXPECT_EQ(text::seconds_text(1), "0.000000001");
  EXPECT_EQ(text::seconds_text(-1'500'000'000), "-1.5");
  EXPECT_EQ(text::seconds_text(1'700'000'000'123'456'789), "1700000000.123456789");
  EXPECT_EQ(text::seconds_text(20'000'000'000), "20");
}

TEST(Labels, AreTheWireNamesInSnakeCase) {
  EXPECT_EQ(text::snake_case("MacroSlip"), "macro_slip");
  EXPECT_EQ(reason_text(estimator::StopReason::kTraceEnd), "trace_end");
  EXPECT_EQ(reason_text(estimator::StopReason::kClampNotFollowed), "clamp_not_followed");
  EXPECT_EQ(reason_text(estimator::StopReason::kLag), "lag");
  EXPECT_EQ(outcome_text(daemon::Outcome::kInconclusive), "inconclusive");
}

constexpr std::int64_t kMs = 1'000'000;

// What a table or verdict prints.
class Printed {
 public:
  Printed() : file_(std::tmpfile()) {}
  ~Printed() { std::fclose(file_); }
  std::FILE* file() { return file_; }
  std::string text() {
    std::string result(static_cast<std::size_t>(std::ftell(file_)), '\0');
    std::rewind(file_);
    EXPECT_EQ(std::fread(result.data(), 1, result.size(), file_), result.size());
    return result;
  }

 private:
  std::FILE* file_;
};

class OwnFrameView : public testing::Test {
 protected:
  void slip(std::int64_t t_ns, double sigma, estimator::Phase phase, bool stop) {
    daemon::SlipValues values;
    values.available = true;
    values.mu_star = 0.1;
    values.sigma_star_percent = sigma;
    values.phase = phase;
    values.macro_slip_stop = stop;
    show(t_ns, frames_.pack(values, counter_++));
  }
  void estimate(std::int64_t t_ns, double mu_max) {
    daemon::EstimateValues values;
    values.kind = estimator::PeakKind::kValue;
    values.mu_max = mu_max;
    values.mu_max_std = 0.0004;
    show(t_ns, frames_.pack(values, 0));
  }
  void show(std::int64_t t_ns, const can::CanFrame& frame) {
    const auto view = decoder_.decode(frame);
    ASSERT_TRUE(view);
    table_.on_frame(t_ns, *view);
    verdict_.on_frame(t_ns, *view);
  }

  daemon::FrameIdentifiers identifiers_;
  daemon::OwnFrames frames_{identifiers_};
  monitor::OwnFrameDecoder decoder_{identifiers_};
  Printed table_out_;
  monitor::BusTable table_{table_out_.file()};
  Verdict verdict_;
  std::uint8_t counter_ = 0;
};

long rows(const std::string& text) { return std::count(text.begin(), text.end(), '\n') - 1; }

TEST_F(OwnFrameView, TableGrowsWithTimeAndChange) {
  for (int i = 0; i < 11; ++i) slip(i * 100 * kMs, 2.0, estimator::Phase::kQuiet, false);
  EXPECT_EQ(rows(table_out_.text()), 2);  // at 0 and 0.5 s; that at 1 s waits for company
  slip(1010 * kMs, 2.1, estimator::Phase::kExcited, false);
  slip(1020 * kMs, 3.0, estimator::Phase::kMacroSlip, true);
  estimate(1020 * kMs, 0.1047);
  slip(1100 * kMs, 3.1, estimator::Phase::kPeak, true);  // after the stop no row of its own
  const std::string text = table_out_.text();
  EXPECT_EQ(rows(text), 4) << text;  // an excited phase alone is no change to speak of
  EXPECT_NE(
      text.find(
          "1.020 s  -                -  macro slip   0.1000    3.00    0.0000  STOP  0.1047 std "
          "0.0004"),
      std::string::npos)
      << text;
}

TEST_F(OwnFrameView, TableShowsTheRequestAndIsQuietWhileNothingGoesOn) {
  daemon::StatusValues idle;
  idle.state = daemon::State::kIdle;
  show(0, frames_.pack(idle, 0));
  for (int i = 0; i < 9; ++i) slip(i * 200 * kMs, 2.0, estimator::Phase::kQuiet, false);
  EXPECT_EQ(rows(table_out_.text()), 1);
  daemon::ClampValues clamp;
  clamp.request_active = true;
  clamp.secondary_force_N = 2345.0;
  show(1900 * kMs, frames_.pack(clamp, 0));
  daemon::StatusValues ramping;
  ramping.state = daemon::State::kRamping;
  show(1901 * kMs, frames_.pack(ramping, 1));
  slip(1910 * kMs, 2.0, estimator::Phase::kQuiet, false);
  EXPECT_NE(table_out_.text().find("ramping       2345  quiet"), std::string::npos)
      << table_out_.text();
}

TEST_F(OwnFrameView, WrongProtectionIsShownNotBelieved) {
  can::CanFrame frame = frames_.pack(daemon::EstimateValues{}, 0);
  frame.data[0] ^= 1;
  show(0, frame);
  EXPECT_NE(table_out_.text().find("wrong_crc"), std::string::npos);
  const auto view = monitor::OwnFrameDecoder(identifiers_).decode(frame);
  const auto json = nlohmann::json::parse(monitor::json_line(1'500'000'000, *view));
  EXPECT_EQ(json.at("protection"), "wrong_crc");
  EXPECT_EQ(json.at("t_s"), 1.5);
  EXPECT_EQ(json.at("message"), "BeltGripEstimate");
  EXPECT_EQ(json.at("labels").at("MuMaxKind"), "None");
}

TEST_F(OwnFrameView, OtherFramesAreNotOurs) {
  can::CanFrame frame = frames_.pack(daemon::SlipValues{}, 0);
  frame.id.extended = true;
  EXPECT_FALSE(decoder_.decode(frame));
  frame.id.extended = false;
  frame.length = 7;
  EXPECT_FALSE(decoder_.decode(frame));
  frame.length = 8;
  frame.id.value = 0x6A4;
  EXPECT_FALSE(decoder_.decode(frame));
}

TEST_F(OwnFrameView, VerdictStandsBesideTheTruth) {
  slip(90'000 * kMs, 2.5, estimator::Phase::kPeak, false);
  slip(90'500 * kMs, 3.2, estimator::Phase::kMacroSlip, true);
  slip(91'000 * kMs, 6.0, estimator::Phase::kMacroSlip, true);
  estimate(90'501 * kMs, 0.1071);
  Truth truth;
  truth.mu_max = 0.105;
  truth.experiments.resize(1);
  truth.experiments[0].peak_s = 89.5;
  truth.experiments[0].sigma_star_peak_percent = 2.53;
  truth.experiments[0].let_go_s = 96.5;
  truth.experiments[0].sigma_star_max_percent = 13.5;
  Printed out;
  verdict_.print(out.file(), truth);
  const std::string text = out.text();
  EXPECT_NE(text.find("0.1071, std 0.0004     0.1050 (error +2.0 %)"), std::string::npos) << text;
  EXPECT_NE(text.find("at 90.50 s             peak at 89.50 s (+1.00 s)"), std::string::npos)
      << text;
  EXPECT_NE(text.find("3.20 %"), std::string::npos);
  Printed nothing;
  Verdict().print(nothing.file(), truth);
  EXPECT_NE(nothing.text().find("no result"), std::string::npos);
}

}  // namespace
}  // namespace beltgrip::cli
