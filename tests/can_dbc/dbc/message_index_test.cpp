#include "can_dbc/dbc/message_index.h"

#include <gtest/gtest.h>

#include <map>
#include <random>

namespace beltgrip::can {
namespace {

MessageDef message(const char* name, std::uint32_t id, bool extended, bool j1939 = false) {
  MessageDef definition;
  definition.name = name;
  definition.id = {id, extended};
  definition.j1939 = j1939;
  return definition;
}

std::string name_of(const MessageIndex& index, std::vector<const Database*> databases, CanId id) {
  const MessageIndex::Entry* entry = index.lookup(id);
  return entry == nullptr ? "" : databases[entry->database]->messages[entry->message].name;
}

TEST(ParameterGroup, LeavesOutTheDestinationOfPdu1) {
  EXPECT_EQ(parameter_group(0x0CF00400), 0xF004U);  // EEC1: PDU2
  EXPECT_EQ(parameter_group(0x18FEF1FE), 0xFEF1U);
  EXPECT_EQ(parameter_group(0x18EA12FE), 0xEA00U);   // request, to 0x12: PDU1
  EXPECT_EQ(parameter_group(0x09F11201), 0x1F112U);  // NMEA 2000: data page 1
  EXPECT_EQ(parameter_group(0x1DEFFF09), 0x1EF00U);
}

TEST(ParameterGroup, MaskAndComparisonSayTheSameAsTheNumber) {
  std::mt19937_64 random(6);
  for (int i = 0; i < 100'000; ++i) {
    const auto message = static_cast<std::uint32_t>(random() & kExtendedIdMax);
    auto received = static_cast<std::uint32_t>(random() & kExtendedIdMax);
    if (i % 2 == 0) {  // the same group more often than chance has it
      received = (received & ~0x03FF'FF00U) | (message & 0x03FF'FF00U);
      if (i % 4 == 0) received ^= 0xFF00U & static_cast<std::uint32_t>(random());
    }
    ASSERT_EQ(is_of_message({received, true}, {message, true}, true),
              parameter_group(received) == parameter_group(message));
    ASSERT_EQ(is_of_message({received, true}, {message, true}, false), received == message);
    ASSERT_FALSE(is_of_message({message, false}, {message, true}, true));
  }
  EXPECT_TRUE(is_of_message({0x123, false}, {0x123, false}, false));
  EXPECT_FALSE(is_of_message({0x123, false}, {0x124, false}, false));
  EXPECT_EQ(identifier_mask({0x123, false}, true), 0x7FFU);
}

TEST(MessageIndex, StandardAndExtendedIdentifiersOfOneNumberDiffer) {
  Database db;
  db.messages = {message("standard", 0x123, false), message("extended", 0x123, true)};
  const MessageIndex index(std::vector<const Database*>{&db});
  EXPECT_EQ(name_of(index, {&db}, {0x123, false}), "standard");
  EXPECT_EQ(name_of(index, {&db}, {0x123, true}), "extended");
  EXPECT_EQ(name_of(index, {&db}, {0x124, true}), "");
  EXPECT_EQ(name_of(index, {&db}, {0x124, false}), "");
  EXPECT_EQ(name_of(index, {&db}, {0x12345678, false}), "");
}

TEST(MessageIndex, J1939MatchesByGroupAnySourcePriorityAndDestination) {
  Database db;
  db.messages = {message("EEC1", 0x0CF004FE, true, true),
                 message("request", 0x18EAFFFE, true, true),
                 message("exact", 0x18FEF100, true, false)};
  const MessageIndex index(std::vector<const Database*>{&db});
  EXPECT_EQ(name_of(index, {&db}, {0x0CF00400, true}), "EEC1");
  EXPECT_EQ(name_of(index, {&db}, {0x18F00431, true}), "EEC1");
  EXPECT_EQ(name_of(index, {&db}, {0x0CF00500, true}), "");
  EXPECT_EQ(name_of(index, {&db}, {0x0DF00400, true}), "");  // another data page
  EXPECT_EQ(name_of(index, {&db}, {0x18EA0021, true}), "request");
  EXPECT_EQ(name_of(index, {&db}, {0x18FEF100, true}), "exact");
  EXPECT_EQ(name_of(index, {&db}, {0x18FEF101, true}), "");
}

TEST(MessageIndex, TheSameSourceWinsThenTheNullSourceThenTheFirst) {
  Database db;
  db.messages = {
      message("from 3", 0x18FEF103, true, true), message("from any", 0x18FEF1FE, true, true),
      message("from 5", 0x18FEF105, true, true), message("other", 0x18FEF203, true, true)};
  const MessageIndex index(std::vector<const Database*>{&db});
  EXPECT_EQ(name_of(index, {&db}, {0x18FEF103, true}), "from 3");
  EXPECT_EQ(name_of(index, {&db}, {0x1CFEF105, true}), "from 5");
  EXPECT_EQ(name_of(index, {&db}, {0x18FEF107, true}), "from any");
  EXPECT_EQ(name_of(index, {&db}, {0x18FEF207, true}), "other");
}

TEST(MessageIndex, TwoFilesWithOneIdentifierAreReportedAndTheFirstIsUsed) {
  Database first;
  first.messages = {message("a", 0x100, false), message("b", 0x18FEF1FE, true, true),
                    message("again", 0x100, false)};
  Database second;
  second.messages = {message("c", 0x200, false), message("d", 0x100, false),
                     message("e", 0x0CFEF1FE, true, true)};
  const std::vector<const Database*> both{&first, &second};
  const MessageIndex index(both);
  EXPECT_EQ(name_of(index, both, {0x100, false}), "a");
  EXPECT_EQ(name_of(index, both, {0x200, false}), "c");
  EXPECT_EQ(name_of(index, both, {0x18FEF110, true}), "b");
  ASSERT_EQ(index.conflicts().size(), 2U);
  EXPECT_EQ(index.conflicts()[0].used, (MessageIndex::Entry{0, 0}));
  EXPECT_EQ(index.conflicts()[0].ignored, (MessageIndex::Entry{1, 1}));
  EXPECT_EQ(index.conflicts()[1].ignored, (MessageIndex::Entry{1, 2}));
}

TEST(MessageIndex, EqualsAMapForManyIdentifiers) {
  std::mt19937_64 random(5);
  Database db;
  std::map<std::pair<bool, std::uint32_t>, std::uint32_t> wanted;
  for (std::uint32_t i = 0; i < 100'000; ++i) {
    const bool extended = random() % 8 != 0;
    const auto id =
        static_cast<std::uint32_t>(random() & (extended ? kExtendedIdMax : kStandardIdMax));
    db.messages.push_back(message("", id, extended));
    wanted.emplace(std::pair{extended, id}, i);
  }
  const MessageIndex index(std::vector<const Database*>{&db});
  for (const auto& [key, place] : wanted) {
    ASSERT_EQ(index.lookup({key.second, key.first})->message, place);
  }
  for (int i = 0; i < 100'000; ++i) {
    const auto id = static_cast<std::uint32_t>(random() & kExtendedIdMax);
    ASSERT_EQ(index.lookup({id, true}) != nullptr, wanted.contains({true, id}));
  }
}

TEST(MessageIndex, WithoutMessagesFindsNothing) {
  EXPECT_EQ(MessageIndex().lookup({0x123, false}), nullptr);
  const Database empty;
  EXPECT_EQ(MessageIndex(std::vector<const Database*>{&empty}).lookup({0x123, true}), nullptr);
}

}  // namespace
}  // namespace beltgrip::can
