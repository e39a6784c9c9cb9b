// A table of signals as a log, on tables written here by hand.
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <fstream>

#include "can_dbc/dbc/signal_codec.h"
#include "tools/table/table_head.h"
#include "tools/table/table_log.h"

namespace beltgrip::table {
namespace {

class Table : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("beltgrip_table_" +
               std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string write(const std::string& text) {
    std::string path = (folder_ / "table.csv").string();
    std::ofstream(path) << text;
    return path;
  }
  // "t_ns name=value" of every frame.
  static std::vector<std::string> frames(const std::string& path, double rate_Hz = 0.0) {
    const auto head = read_head(path);
    if (!head) return {};
    const can::Database columns = database_of(*head);
    const auto log = open(path, columns, rate_Hz);
    std::vector<std::string> out;
    can::LogRecord record;
    while (log->next(record)) {
      const can::MessageDef* message = columns.find_message(record.frame.id);
      const can::SignalCodec codec(message->signals.front());
      char line[100];
      std::snprintf(line, sizeof line, "%lld %s=%.10g", static_cast<long long>(record.t_ns),
                    std::string(message->name).c_str(), codec.decode(record.frame.payload()));
      out.emplace_back(line);
    }
    return out;
  }
  using Lines = std::vector<std::string>;

 private:
  std::filesystem::path folder_;
};

// As a scan tool writes it.
constexpr const char* kScan =
    "# Some tool\n#\n"
    "Record,Primary Rev Speed,ATF Temp.,Wheel (2),Actual Pressure,Stop Light,Gear\r\n"
    "Unit,rpm,degree C,rpm,MPa,,\r\n"
    "0,821.00,9.00,0.00,0.60,OFF,D\n"
    "1,830.00,9.00,,-0.59,ON,R\n";

TEST_F(Table, CommentsUnitsTextsAndNoTime) {
  const auto head = read_head(write(kScan));
  ASSERT_TRUE(head);
  EXPECT_FALSE(head->time);
  EXPECT_EQ(head->rows, 2U);
  ASSERT_EQ(head->columns.size(), 7U);
  EXPECT_EQ(head->columns[2].unit, "degree C");
  EXPECT_EQ(head->columns[3].name, "Wheel (2)");
  EXPECT_EQ(head->columns[4].unit, "MPa");
  const can::Database columns = database_of(*head);
  const can::SignalDef& pressure = columns.find_message("Actual Pressure")->signals[0];
  EXPECT_DOUBLE_EQ(pressure.scale, 0.01);  // two decimals
  const can::SignalDef& light = columns.find_message("Stop Light")->signals[0];
  EXPECT_EQ(light.values.at(0), "OFF");
  EXPECT_EQ(light.values.at(1), "ON");
  EXPECT_THROW(open(write(kScan), columns, 0.0), can::LogOpenError);
  // Half a row a second. The wheel has no second value; what is not 0 or 1 follows from 2 on.
  EXPECT_EQ(
      frames(write(kScan), 0.5),
      (Lines{"0 Record=0", "0 Primary Rev Speed=821", "0 ATF Temp.=9", "0 Wheel (2)=0",
             "0 Actual Pressure=0.6", "0 Stop Light=0", "0 Gear=2", "2000000000 Record=1",
             "2000000000 Primary Rev Speed=830", "2000000000 ATF Temp.=9",
             "2000000000 Actual Pressure=-0.59", "2000000000 Stop Light=1", "2000000000 Gear=3"}));
}

TEST_F(Table, TimesInTheirUnits) {
  EXPECT_EQ(frames(write("t[s],a[rpm]\n0.005,1\n0.015,2.5e3\n")),
            (Lines{"5000000 a=1", "15000000 a=2500"}));
  EXPECT_EQ(frames(write("Time (ms);a (rpm)\n5;1,5\n15;2\n")),
            (Lines{"5000000 a=1.5", "15000000 a=2"}));
  EXPECT_EQ(frames(write("time_us\ta\n5\t1\n")), (Lines{"5000 a=1"}));
  EXPECT_EQ(frames(write("Zeit,a\n10:00:01.5,1\n")), (Lines{"36001500000000 a=1"}));
  EXPECT_EQ(frames(write("time,a\nms,rpm\n5,1\n")), (Lines{"5000000 a=1"}));
}

TEST_F(Table, WhatIsBadIsLeftOutAndCounted) {
  const std::string path = write("t,a,\"b, c\"\n0,1,\n1,n/a,\"3\"\nnoon,1,1\n2\n3,?,4\n");
  EXPECT_EQ(frames(path), (Lines{"0 a=1", "1000000000 b, c=3", "3000000000 b, c=4"}));
  const auto log = open(path, database_of(*read_head(path)), 0.0);
  can::LogRecord record;
  while (log->next(record)) {
  }
  EXPECT_EQ(log->stats().lines_bad, 2U);
  ASSERT_EQ(log->stats().first_bad.size(), 2U);
  EXPECT_EQ(log->stats().first_bad[0].line, 4U);
  EXPECT_EQ(log->stats().first_bad[1].line, 5U);
}

// Nobody knows which of the cells belong to which column.
TEST_F(Table, ARowWithMoreOrFewerCellsThanTheHeaderHasNoValues) {
  const std::string path = write("t,a,b\n0,1,2\n1,1,2,3\n2,3\n3,4,5\n4,6,7\n4.5,6,7,\n5,8");
  EXPECT_EQ(frames(path), (Lines{"0 a=1", "0 b=2", "3000000000 a=4", "3000000000 b=5",
                                 "4000000000 a=6", "4000000000 b=7"}));
  const auto log = open(path, database_of(*read_head(path)), 0.0);
  can::LogRecord record;
  while (log->next(record)) {
  }
  EXPECT_EQ(log->stats().lines_bad, 4U);
  ASSERT_EQ(log->stats().first_bad.size(), 4U);
  EXPECT_EQ(log->stats().first_bad[0].line, 3U);
  EXPECT_EQ(log->stats().first_bad[0].reason,
            "more cells than the header has; expected decimal points");
  EXPECT_EQ(log->stats().first_bad[1].line, 4U);
  EXPECT_EQ(log->stats().first_bad[2].line, 7U) << "no other row ends with a separator";
  EXPECT_EQ(log->stats().first_bad[3].line, 8U) << "cut";
}

// It says nothing of the columns either, and its time passes.
TEST_F(Table, ARowOfAnotherWidthIsNoRowOfTheHead) {
  const std::string path = write("a,b\n1,2\n0,25,x,7\n3,4\n");
  const auto head = read_head(path);
  ASSERT_TRUE(head);
  EXPECT_EQ(head->columns[1].numbers, 2U);
  EXPECT_TRUE(head->columns[1].texts.empty());
  EXPECT_EQ(frames(path, 1.0), (Lines{"0 a=1", "0 b=2", "2000000000 a=3", "2000000000 b=4"}));
}

TEST_F(Table, OfTwoColumnsOfOneNameTheFirstCounts) {
  EXPECT_EQ(frames(write("t,a,a\n0,1,2\n")), (Lines{"0 a=1"}));
}

TEST_F(Table, WhatIsNoTable) {
  EXPECT_FALSE(read_head(write("a\x01,b\x02\n1,2\n")));  // no names
  std::string many = "a";
  for (int i = 0; i < 5000; ++i) many += ",a";
  EXPECT_FALSE(read_head(write(many + "\n1,2\n")));
  EXPECT_FALSE(read_head(write("time,id,data\n0.1,123,0011\n")));  // frames
  EXPECT_FALSE(read_head(write("Some Spy,Export\nBus,HS CAN\ntime,id,data\n0.1,123,0011\n")));
  EXPECT_FALSE(read_head(write("t,a,b\n")));         // no row
  EXPECT_FALSE(read_head(write("1,2,3\n4,5,6\n")));  // no names
  EXPECT_FALSE(read_head(write("")));
  EXPECT_FALSE(read_head(write("(1.0) can0 123#00\n")));
}

}  // namespace
}  // namespace beltgrip::table
