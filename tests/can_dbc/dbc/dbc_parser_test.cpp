#include "can_dbc/dbc/parser.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <ctime>
#include <random>

#include "can_dbc/dbc/message_index.h"

namespace beltgrip::can {
namespace {

constexpr const char* kMessage =
    "BO_ 291 M: 8 A\n"
    " SG_ s : 0|8@1+ (1,0) [0|255] \"\" A\n"
    " SG_ t : 8|8@1+ (1,0) [0|255] \"\" A\n";
const std::string kNodes = "BU_: A B\n";

// Most texts here have no header; that it is missing has a test of its own.
DbcParseResult parse(const std::string& text) {
  DbcParseResult result = parse_dbc(text);
  std::erase_if(result.problems, [](const Problem& p) { return p.code == "header-missing"; });
  return result;
}

std::string codes(const DbcParseResult& result) {
  std::string all;
  for (const Problem& problem : result.problems) {
    if (!all.empty()) all += ' ';
    all += problem.code;
  }
  return all;
}

// "line:column code" of each problem.
std::string places(const DbcParseResult& result) {
  std::string all;
  for (const Problem& problem : result.problems) {
    if (!all.empty()) all += ", ";
    all += std::to_string(problem.line) + ':' + std::to_string(problem.column) + ' ' + problem.code;
  }
  return all;
}

const MessageDef& only_message(const DbcParseResult& result) {
  EXPECT_EQ(result.database.messages.size(), 1U);
  return result.database.messages.at(0);
}

const SignalDef& signal(const DbcParseResult& result, const std::string& name) {
  const SignalDef* found = result.database.messages.at(0).find_signal(name);
  if (found == nullptr) throw std::runtime_error("no signal " + name);
  return *found;
}

// --- the quick way through a usual line
// ------------------------------------------------------------

// All that one signal is.
std::string told(const DbcParseResult& result) {
  std::string all = places(result) + " | ";
  for (const Problem& problem : result.problems) all += problem.text + '\n';
  for (const Statement& kept : result.database.other_statements) all += kept.text + '\n';
  for (const MessageDef& message : result.database.messages) {
    for (const SignalDef& s : message.signals) {
      all += s.name + ' ' + std::to_string(s.start_bit) + ' ' + std::to_string(s.length) + ' ' +
             std::to_string(static_cast<int>(s.byte_order)) +
             std::to_string(static_cast<int>(s.type));
      for (const double value : {s.scale, s.offset, s.usage->minimum, s.usage->maximum}) {
        all += ' ' + std::to_string(std::bit_cast<std::uint64_t>(value));
      }
      all += " [" + std::string(s.unit) + "] " + (s.is_multiplexer ? "M" : "-");
      for (const Text receiver : s.usage->receivers) all += ' ' + std::string(receiver);
      if (s.multiplexed_by != nullptr) {
        all += " by " + s.multiplexed_by->selector;
        for (const auto& [low, high] : s.multiplexed_by->ranges) {
          all += ' ' + std::to_string(low) + '-' + std::to_string(high);
        }
      }
      all += '\n';
    }
  }
  return all;
}

// The quick reader knows a line by its line feed: one that a carriage return alone ends is read by
// the other. Both must say the same of it, whatever it is.
TEST(DbcParser, ReadsAUsualSignalAsAnyOther) {
  const std::string before =
      "BS_:\nBU_: A B\nBO_ 291 M: 8 A\n SG_ mux M : 0|8@1+ (1,0) [0|0] \"\" A\n";
  const std::vector<std::string> lines{
      " SG_ Speed : 7|16@0+ (0.25,-40) [-40|23.75] \"degC\" A,B",
      " SG_ s m12 : 8|8@1- (1,0) [0|255] \"\"  A",
      "SG_ _x m3M : 16|4@1+ (0.000001,1000000) [-1.50|+3] \"\xC2\xB0 C\" Vector__XXX",
      "\tSG_ a1: 63|64@0- (123456789012345,1E-05) [0|0.1] \"m/s\" A , B"};
  const std::string pool = " :|@+-(),[]\"/\\;_mM019.eExX\t\rAz\xB0\xC2";
  std::mt19937 random(4);
  const auto below = [&](std::size_t end) { return static_cast<std::size_t>(random()) % end; };
  for (int round = 0; round < 40'000; ++round) {
    std::string line = lines[below(lines.size())];
    for (std::size_t changes = below(3); changes > 0; --changes) {
      const std::size_t at = below(line.size());
      const char c = pool[below(pool.size())];
      const std::size_t kind = below(3);
      if (kind == 0) line[at] = c;
      if (kind == 1) line.insert(at, 1, c);
      if (kind == 2) line.erase(at, 1);
    }
    ASSERT_EQ(told(parse(before + line + '\n')), told(parse(before + line + '\r'))) << line;
  }
}

// --- what every file has -------------------------------------------------------------------------

TEST(DbcParser, ReadsAWholeFileWithoutAProblem) {
  const DbcParseResult result = parse(R"(VERSION "1.5"

NS_ :
	NS_DESC_
	CM_
	BA_DEF_
	BO_TX_BU_

BS_: 500000 : 1,2

BU_: Engine Gateway
VAL_TABLE_ OnOff 1 "on" 0 "off" ;

BO_ 291 EngineData: 8 Engine
 SG_ Speed : 7|16@0+ (0.25,-10) [-10|16373.75] "rpm" Gateway,Engine
 SG_ Mode M : 16|8@1- (1,0) [0|0] "" Vector__XXX
 SG_ Torque m3 : 24|16@1- (5E-1,1e1) [-1E3|+1000.5] "N m"  Gateway

BO_ 2566844158 Extended: 64 Vector__XXX

BO_TX_BU_ 291 : Engine,Gateway;

EV_ Lamp: 0 [0|1] "u" 0.5 3 DUMMY_NODE_VECTOR0 Engine,Gateway;
ENVVAR_DATA_ Lamp: 5;

CM_ "of the network";
CM_ BU_ Engine "of a node";
CM_ BO_ 291 "of a
message";
CM_ SG_ 291 Speed "of a signal; with \"quotes\"";
CM_ EV_ Lamp "of a variable";
BA_DEF_ "BusType" STRING ;
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;
BA_DEF_ BO_ "GenMsgSendType" ENUM "cyclic","on change";
BA_DEF_ SG_ "Start" FLOAT 0 1.5;
BA_DEF_REL_ BU_SG_REL_ "Timeout" INT 0 100;
BA_DEF_DEF_ "BusType" "CAN";
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_DEF_DEF_ "GenMsgSendType" "on change";
BA_DEF_DEF_REL_ "Timeout" 10;
BA_ "BusType" "CAN FD";
BA_ "GenMsgCycleTime" BO_ 291 20;
BA_ "GenMsgSendType" BO_ 291 0;
BA_ "Start" SG_ 291 Speed 0.5;
BA_REL_ "Timeout" BU_SG_REL_ Gateway SG_ 291 Speed 50;
VAL_ 291 Mode 0 "zero" 3 "three" -1 "minus one" ;
VAL_ Lamp 1 "on" 0 "off" ;
SIG_GROUP_ 291 Group 1 : Speed Mode;
SIG_VALTYPE_ 291 Torque : 0;
SG_MUL_VAL_ 291 Torque Mode 3-3, 5-10;
)");
  EXPECT_EQ(places(result), "");
  const Database& db = result.database;
  EXPECT_EQ(db.version, "1.5");
  EXPECT_EQ(db.nodes, (std::vector<Text>{"Engine", "Gateway"}));
  EXPECT_EQ(db.new_symbols.size(), 4U);
  EXPECT_EQ(db.bit_timing, "500000 : 1,2");
  EXPECT_EQ(db.comment, "of the network");
  EXPECT_EQ(db.node_details.at("Engine").comment, "of a node");
  EXPECT_EQ(db.attributes.at("BusType"), "CAN FD");
  EXPECT_EQ(db.value_tables.at("OnOff").at(1), "on");
  ASSERT_EQ(db.messages.size(), 2U);
  const MessageDef& message = db.messages[0];
  EXPECT_EQ(message.name, "EngineData");
  EXPECT_EQ(message.id, (CanId{291, false}));
  EXPECT_EQ(message.length, 8U);
  EXPECT_EQ(message.transmitter, "Engine");
  EXPECT_EQ(message.senders, (std::vector<Text>{"Engine", "Gateway"}));
  EXPECT_EQ(message.comment, "of a\nmessage");
  EXPECT_EQ(message.cycle_ms, 20.0);
  EXPECT_EQ(message.attributes.at("GenMsgSendType"), "cyclic");
  ASSERT_EQ(message.groups.size(), 1U);
  EXPECT_EQ(message.groups[0].signals, (std::vector<Text>{"Speed", "Mode"}));
  const SignalDef& speed = message.signals[0];
  EXPECT_EQ(speed.start_bit, 7U);
  EXPECT_EQ(speed.length, 16U);
  EXPECT_EQ(speed.byte_order, ByteOrder::kBig);
  EXPECT_EQ(speed.scale, 0.25);
  EXPECT_EQ(speed.offset, -10.0);
  EXPECT_EQ(speed.usage->maximum, 16373.75);
  EXPECT_EQ(speed.unit, "rpm");
  EXPECT_EQ(speed.usage->receivers, (std::vector<Text>{"Gateway", "Engine"}));
  EXPECT_EQ(speed.comment, "of a signal; with \"quotes\"");
  EXPECT_EQ(speed.attributes.at("Start"), "0.5");
  const SignalDef& mode = message.signals[1];
  EXPECT_TRUE(mode.is_multiplexer);
  EXPECT_EQ(mode.type, ValueType::kSigned);
  EXPECT_EQ(mode.values.at(-1), "minus one");
  const SignalDef& torque = message.signals[2];
  EXPECT_EQ(torque.scale, 0.5);
  EXPECT_EQ(torque.offset, 10.0);
  EXPECT_EQ(torque.usage->minimum, -1000.0);
  EXPECT_EQ(torque.usage->maximum, 1000.5);
  ASSERT_TRUE(torque.multiplexed_by);
  EXPECT_EQ(torque.multiplexed_by->selector, "Mode");
  EXPECT_EQ(torque.multiplexed_by->ranges,
            (std::vector<std::pair<std::uint64_t, std::uint64_t>>{{3, 3}, {5, 10}}));
  EXPECT_EQ(db.messages[1].id, (CanId{0x18FEEEFE, true}));
  ASSERT_EQ(db.environment_variables.size(), 1U);
  EXPECT_EQ(db.environment_variables[0].data_bytes, 5U);
  EXPECT_EQ(db.environment_variables[0].comment, "of a variable");
  EXPECT_EQ(db.environment_variables[0].values.at(0), "off");
  EXPECT_EQ(db.environment_variables[0].access_nodes.size(), 2U);
  ASSERT_EQ(db.attribute_definitions.size(), 5U);
  EXPECT_EQ(db.attribute_definitions[2].choices, (std::vector<Text>{"cyclic", "on change"}));
  EXPECT_EQ(db.attribute_definitions[2].default_value, "on change");
  ASSERT_EQ(db.relations.size(), 1U);
  EXPECT_EQ(db.relations[0].object, "EngineData.Speed");
  EXPECT_TRUE(db.other_statements.empty());
}

TEST(DbcParser, SectionsInAnyOrder) {
  const DbcParseResult result = parse(
      "VAL_ 291 s 1 \"one\" ;\n"
      "BA_ \"GenMsgCycleTime\" BO_ 291 50;\n"
      "CM_ SG_ 291 s \"before its message\";\n"
      "SIG_VALTYPE_ 291 f : 1;\n"
      "BA_DEF_ BO_ \"GenMsgCycleTime\" INT 0 1000;\n"
      "BO_ 291 M: 8 A\n"
      " SG_ s : 0|8@1+ (1,0) [0|255] \"\" A\n"
      " SG_ f : 32|32@1- (1,0) [0|0] \"\" A\n"
      "CM_ BO_ 291 \"between\";\n"
      "BO_ 292 N: 8 A\n"
      "BU_: A\n");
  EXPECT_EQ(places(result), "6:1 section-order, 11:1 section-order");
  EXPECT_EQ(signal(result, "s").values.at(1), "one");
  EXPECT_EQ(signal(result, "s").comment, "before its message");
  EXPECT_EQ(signal(result, "f").type, ValueType::kFloat32);
  EXPECT_EQ(result.database.messages[0].cycle_ms, 50.0);
}

TEST(DbcParser, HeaderMissing) {
  const std::string message = "BO_ 1 M: 8 Vector__XXX\n";
  EXPECT_EQ(places(parse_dbc("BS_:\nBU_:\n" + message)), "");
  EXPECT_EQ(places(parse_dbc(message)), "1:1 header-missing");
  EXPECT_EQ(parse_dbc(message).problems[0].text, "no BS_: and no BU_: in the file");
  EXPECT_EQ(parse_dbc("BS_:\n" + message).problems[0].text, "no BU_: in the file");
  EXPECT_EQ(parse_dbc("BU_:\n" + message).problems[0].text, "no BS_: in the file");
}

TEST(DbcParser, OddSpacing) {
  const DbcParseResult result = parse(
      "BU_ :A\n"
      "BO_\t291   M :8 A\r\n\r\n"
      "SG_ s:0|8@1+(1,0)[0|255]\"\"A\r\n"
      "      SG_   t  m3   :   8 | 8 @ 1 -  ( 2 , 3 )  [ 0 | 1 ]  \"x\"  A , A\r\n"
      "\tSG_ u M:16|8@1+(+1.,-.5)[0|1]\"\" A SG_ v : 24|8@1+ (1,0) [0|1] \"\" A\n"
      "CM_  SG_ 291  s  \"text\"  ;CM_ BO_ 291 \"more\";\n"
      "VAL_ 291 s 0\"a\"1\"b\";");
  EXPECT_EQ(codes(result), "");
  ASSERT_EQ(only_message(result).signals.size(), 4U);
  EXPECT_EQ(signal(result, "t").type, ValueType::kSigned);
  EXPECT_EQ(signal(result, "t").multiplexed_by->selector, "u");
  EXPECT_EQ(signal(result, "u").offset, -0.5);
  EXPECT_EQ(signal(result, "s").comment, "text");
  EXPECT_EQ(only_message(result).comment, "more");
  EXPECT_EQ(signal(result, "s").values.at(1), "b");
}

TEST(DbcParser, LineBreaksOfEveryKind) {
  for (const char* line_break : {"\n", "\r\n", "\r"}) {
    std::string text;
    for (const char* line :
         {"BU_: A", "BO_ 291 M: 8 A", " SG_ s : 0|8@1+ (1,0) [0|1] \"\" A", "BO_ 2000000 N: 8 A"}) {
      text += line;
      text += line_break;
    }
    const DbcParseResult result = parse(text);
    EXPECT_EQ(places(result), "4:5 id-extended");
    EXPECT_EQ(result.database.messages.size(), 2U);
  }
}

TEST(DbcParser, EmptyAndMissingHeaderParts) {
  EXPECT_EQ(codes(parse("VERSION \"\"\nNS_ :\nBS_:\nBU_:\nBO_ 1 M: 8 Vector__XXX\n")), "");
  EXPECT_EQ(codes(parse("NS_:\nBU_: A\nBO_ 1 M: 8 A\n")), "");
  // The list of new symbols on one line, then a statement that is also in the list.
  const DbcParseResult result =
      parse("NS_ : CM_ BA_DEF_ VAL_\nCM_ \"c\";\nBO_ 1 M: 8 Vector__XXX\n");
  EXPECT_EQ(places(result), "3:1 section-order");
  EXPECT_EQ(result.database.new_symbols.size(), 3U);
  EXPECT_EQ(result.database.comment, "c");
  // No BS_ or BU_ behind the list.
  const DbcParseResult direct = parse(
      "NS_ :\n\tNS_DESC_\n\tCM_\n\tBO_TX_BU_\nBO_ 1 M: 8 Vector__XXX\nVAL_TABLE_ t 0 \"x\";\n");
  EXPECT_EQ(places(direct), "6:1 section-order");
  EXPECT_EQ(direct.database.messages.size(), 1U);
  EXPECT_EQ(direct.database.value_tables.size(), 1U);
}

TEST(DbcParser, NodesOnSeveralLines) {
  const DbcParseResult result = parse("BU_: A B\n  C D\n  E\nBO_ 1 M: 8 E\n");
  EXPECT_EQ(codes(result), "");
  EXPECT_EQ(result.database.nodes.size(), 5U);
  EXPECT_EQ(parse("BU_: A,B;\nBO_ 1 M: 8 A\n").database.nodes.size(), 2U);
}

// --- identifiers ---------------------------------------------------------------------------------

TEST(DbcParser, Identifiers) {
  struct Case {
    const char* id;
    CanId wanted;
    const char* code;
  };
  for (const Case& c :
       {Case{"2047", {2047, false}, ""}, Case{"2048", {2048, true}, "id-extended"},
        Case{"419360254", {419360254, true}, "id-extended"}, Case{"2147483648", {0, true}, ""},
        Case{"2684354559", {0x1FFFFFFF, true}, ""},
        Case{"4294967295", {0x1FFFFFFF, true}, "id-range"},
        Case{"1073741824", {0, true}, "id-extended"}, Case{"0x123", {0x123, false}, "hex-id"},
        Case{"0X9FFFFFFF", {0x1FFFFFFF, true}, "hex-id"}, Case{"1A3", {0x1A3, false}, "hex-id"},
        Case{"-2147483647", {1, true}, "negative-id"}}) {
    const DbcParseResult result = parse("BO_ " + std::string(c.id) + " M: 8 Vector__XXX\n");
    EXPECT_EQ(codes(result), c.code) << c.id;
    EXPECT_EQ(only_message(result).id, c.wanted) << c.id;
  }
}

TEST(DbcParser, IdentifierOfMoreThan32BitsIsAnErrorAndItsSignalsAreKeptAsText) {
  const DbcParseResult result =
      parse("BO_ 4294967296 M: 8 A\n SG_ s : 0|8@1+ (1,0) [0|1] \"\" A\nBO_ 5 N: 8 Vector__XXX\n");
  EXPECT_EQ(places(result), "1:5 syntax");
  EXPECT_EQ(result.problems[0].severity, Severity::kError);
  EXPECT_EQ(only_message(result).name, "N");
  ASSERT_EQ(result.database.other_statements.size(), 2U);
  EXPECT_EQ(result.database.other_statements[1].text, "SG_ s : 0|8@1+ (1,0) [0|1] \"\" A");
}

TEST(DbcParser, DuplicateNamesAndIdentifiers) {
  const DbcParseResult result = parse(kNodes +
                                      "BO_ 1 M: 8 A\n"
                                      " SG_ s : 0|8@1+ (1,0) [0|1] \"\" A\n"
                                      " SG_ s : 8|8@1+ (1,0) [0|1] \"\" A\n"
                                      "BO_ 1 N: 8 A\n"
                                      "BO_ 2 M: 8 A\n"
                                      "BA_ \"GenMsgCycleTime\" BO_ 1 10;\n"
                                      "BA_DEF_ BO_ \"GenMsgCycleTime\" INT 0 100;\n");
  EXPECT_EQ(places(result), "4:6 duplicate-signal, 5:1 duplicate-id, 6:1 duplicate-name");
  EXPECT_EQ(result.database.messages.size(), 3U);
  EXPECT_EQ(result.database.messages[0].cycle_ms, 10.0);
  EXPECT_EQ(result.database.messages[1].cycle_ms, 10.0);
}

TEST(DbcParser, IndependentSignalsAreKeptButAreNoMessage) {
  const DbcParseResult result = parse(
      "BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX\n"
      " SG_ spare : 0|8@1+ (1,0) [0|255] \"\" Vector__XXX\n"
      "BO_ 1 M: 8 Vector__XXX\n");
  EXPECT_EQ(codes(result), "");
  EXPECT_EQ(only_message(result).name, "M");
  ASSERT_EQ(result.database.unassigned_signals.size(), 1U);
  EXPECT_EQ(result.database.unassigned_signals[0].name, "spare");
  EXPECT_EQ(codes(parse("BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX\n")),
            "no-message");
}

// --- names ---------------------------------------------------------------------------------------

TEST(DbcParser, NamesThatAreNoIdentifiers) {
  const DbcParseResult result = parse(kNodes +
                                      "BO_ 1 1stMessage: 8 A\n"
                                      " SG_ 2nd : 0|8@1+ (1,0) [0|1] \"\" A\n"
                                      " SG_ a-b+c : 8|8@1+ (1,0) [0|1] \"\" A\n"
                                      " SG_ with blank : 16|8@1+ (1,0) [0|1] \"\" A\n"
                                      " SG_ with blank m1 : 24|8@1+ (1,0) [0|1] \"\" A\n"
                                      "BO_ 2 Two words: 8 A\n");
  EXPECT_EQ(places(result),
            "2:7 name-digit, 3:6 name-digit, 4:6 name-characters, 5:6 name-characters, "
            "6:6 name-characters, 6:6 mux-missing, 6:6 duplicate-signal, 7:7 name-characters");
  EXPECT_EQ(result.database.messages[0].signals[2].name, "with blank");
  EXPECT_EQ(result.database.messages[1].name, "Two words");
}

// Found by fuzzing: letters beyond ASCII at the end of a name with a blank before its colon.
TEST(DbcParser, NamesBeyondAscii) {
  const DbcParseResult result = parse(
      "BO_ 1 Lüfter größe : 8 Vector__XXX\n SG_ Öltemperaturµ : 0|8@1+ (1,0) [0|1] \"\" "
      "Vector__XXX\nCM_ SG_ 1 Öltemperaturµ \"text\";\nBO_ 2 \xFC \xFC : 8 Vector__XXX\n");
  EXPECT_EQ(result.database.messages.at(0).name, "Lüfter größe");
  EXPECT_EQ(signal(result, "Öltemperaturµ").comment, "text");
  EXPECT_EQ(result.database.messages.at(1).name, "ü ü");
}

TEST(DbcParser, LongNamesReplaceShortOnesEverywhere) {
  const DbcParseResult result = parse(
      "BU_: N\n"
      "BO_ 1 M_0: 8 N\n"
      " SG_ mux_0 M : 0|8@1+ (1,0) [0|1] \"\" N\n"
      " SG_ s m1 : 8|8@1+ (1,0) [0|1] \"\" N\n"
      "SIG_GROUP_ 1 G 1 : mux_0 s;\n"
      "BA_DEF_ BO_ \"SystemMessageLongSymbol\" STRING ;\n"
      "BA_DEF_ SG_ \"SystemSignalLongSymbol\" STRING ;\n"
      "BA_DEF_ BU_ \"SystemNodeLongSymbol\" STRING ;\n"
      "BA_ \"SystemMessageLongSymbol\" BO_ 1 \"A_message_with_a_long_name\";\n"
      "BA_ \"SystemSignalLongSymbol\" SG_ 1 mux_0 \"A_multiplexer_with_a_long_name\";\n"
      "BA_ \"SystemNodeLongSymbol\" BU_ N \"A_node_with_a_long_name\";\n"
      "CM_ SG_ 1 mux_0 \"by its short name\";\n");
  EXPECT_EQ(codes(result), "");
  const MessageDef& message = only_message(result);
  EXPECT_EQ(message.name, "A_message_with_a_long_name");
  EXPECT_EQ(message.short_name, "M_0");
  EXPECT_EQ(message.transmitter, "A_node_with_a_long_name");
  EXPECT_EQ(message.signals[0].name, "A_multiplexer_with_a_long_name");
  EXPECT_EQ(message.signals[0].comment, "by its short name");
  EXPECT_EQ(message.signals[1].multiplexed_by->selector, "A_multiplexer_with_a_long_name");
  EXPECT_EQ(message.groups[0].signals[0], "A_multiplexer_with_a_long_name");
  EXPECT_EQ(result.database.nodes[0], "A_node_with_a_long_name");
}

TEST(DbcParser, UndeclaredNodesAreOneWarningEach) {
  const DbcParseResult result = parse(
      "BU_: A\nBO_ 1 M: 8 X\n SG_ s : 0|8@1+ (1,0) [0|1] \"\" X,Y,A,Vector__XXX\n"
      " SG_ t : 8|8@1+ (1,0) [0|1] \"\" Y\n");
  EXPECT_EQ(places(result), "2:1 undeclared-node, 3:6 undeclared-node");
  EXPECT_EQ(places(parse("BU_: A A\nBO_ 1 M: 8 A\n")), "1:8 duplicate-node");
}

// --- text ----------------------------------------------------------------------------------------

TEST(DbcParser, EncodingsGiveUtf8) {
  const std::string rest = " A\n";
  const auto unit_of = [](const std::string& text) -> std::string {
    const DbcParseResult result = parse(text);
    EXPECT_EQ(result.database.messages.size(), 1U);
    return result.database.messages.at(0).signals.at(0).unit;
  };
  const std::string head = "BU_: A\nBO_ 1 M: 8 A\n SG_ s : 0|8@1+ (1,0) [0|1] \"";
  EXPECT_EQ(unit_of(head +
                    "\xB0"
                    "C\"" +
                    rest),
            "°C");
  EXPECT_EQ(unit_of(head + "°C\"" + rest), "°C");
  EXPECT_EQ(unit_of(head + "\x80\x85\"" + rest), "€…");
  EXPECT_EQ(unit_of("\xEF\xBB\xBF" + head + "°C\"" + rest), "°C");
  // One piece in each: each is what it can only be.
  EXPECT_EQ(places(parse(head +
                         "\xB0"
                         "C\"" +
                         rest)),
            "3:30 encoding");
  EXPECT_EQ(places(parse(head + "°C\"" + rest)), "");
  const DbcParseResult mixed = parse(head + "°C\" A\n SG_ t : 8|8@1+ (1,0) [0|1] \"\xB5m\"" + rest);
  EXPECT_EQ(signal(mixed, "s").unit, "°C");
  EXPECT_EQ(signal(mixed, "t").unit, "µm");
  EXPECT_EQ(places(parse("\xEF\xBB\xBF"
                         "BO_ 1 M: 8 Vector__XXX\n")),
            "1:1 byte-order-mark");
}

TEST(DbcParser, Utf16) {
  const std::string text = "BO_ 1 M: 8 Vector__XXX\nCM_ \"\xB0\";\n";
  for (const bool little : {true, false}) {
    std::string wide = little ? "\xFF\xFE" : "\xFE\xFF";
    for (const char c : text) {
      if (little) wide += c;
      wide += '\0';
      if (!little) wide += c;
    }
    const DbcParseResult result = parse(wide);
    EXPECT_EQ(codes(result), "utf-16");
    EXPECT_EQ(result.database.comment, "°");
  }
}

TEST(DbcParser, QuotesInsideComments) {
  const auto comment_of = [](const std::string& statement) {
    return parse(std::string(kMessage) + statement + "\nBO_ 2 N: 8 A\n").database;
  };
  EXPECT_EQ(comment_of(R"(CM_ BO_ 291 "a \"b\" c";)").messages[0].comment, R"(a "b" c)");
  EXPECT_EQ(comment_of(R"(CM_ BO_ 291 "ends \"escaped\"";)").messages[0].comment,
            R"(ends "escaped")");
  EXPECT_EQ(comment_of(R"(CM_ BO_ 291 "a "b" c";)").messages[0].comment, R"(a "b" c)");
  EXPECT_EQ(comment_of(R"(CM_ BO_ 291 ""b" at the start";)").messages[0].comment,
            R"("b" at the start)");
  EXPECT_EQ(comment_of("CM_ BO_ 291 \"C:\\path\\\";").messages[0].comment, "C:\\path\\");
  EXPECT_EQ(comment_of("CM_ BO_ 291 \"a; b\n// c /* d */\n\n e\";").messages[0].comment,
            "a; b\n// c /* d */\n\n e");
  EXPECT_EQ(comment_of("CM_ BO_ 291 \"say \"x\"; and \"y\"\";").messages[0].comment,
            "say \"x\"; and \"y\"");
  EXPECT_EQ(comment_of("CM_ BO_ 291 \"\" ;").messages[0].comment, "");
  for (const char* statement : {R"(CM_ BO_ 291 "a "b" c";)", R"(CM_ BO_ 291 "";)"}) {
    EXPECT_EQ(comment_of(statement).messages.size(), 2U) << statement;
  }
  EXPECT_EQ(places(parse(kNodes + kMessage + "CM_ BO_ 291 \"a \"b\" c\";\n")),
            "5:13 quote-in-text");
}

TEST(DbcParser, QuotesInsideUnitsAndValueTexts) {
  const DbcParseResult result =
      parse(kNodes +
            "BO_ 1 M: 8 A\n"
            " SG_ s : 0|8@1+ (1,0) [0|1] \"\"\" A\n"
            " SG_ t : 8|8@1+ (1,0) [0|1] \"5\" rim\" A,B // \"not this\"\n"
            "VAL_ 1 s 0 \"the \"zero\" one\" 1 \"say \\\"1\\\"\" 2 \"\" 3 \"3;\" ;\n");
  EXPECT_EQ(places(result),
            "3:29 quote-in-text, 4:29 quote-in-text, 4:42 source-comment, "
            "5:12 quote-in-text");
  EXPECT_EQ(signal(result, "s").unit, "\"");
  EXPECT_EQ(signal(result, "t").unit, "5\" rim");
  EXPECT_EQ(signal(result, "s").values.at(0), "the \"zero\" one");
  EXPECT_EQ(signal(result, "s").values.at(1), "say \"1\"");
  EXPECT_EQ(signal(result, "s").values.at(2), "");
  EXPECT_EQ(signal(result, "s").values.at(3), "3;");
}

TEST(DbcParser, QuotedTextWithoutEndCostsOnlyItsStatement) {
  const DbcParseResult result = parse(kNodes + kMessage +
                                      "CM_ BO_ 291 \"never closed ;\n"
                                      "CM_ SG_ 291 s \"closed\";\n"
                                      "VAL_ 291 s 0 \"zero 1 \"one\" ;\n"
                                      "VAL_ 291 t 0 \"zero ;\n"
                                      "BO_ 2 N: 8 A\n"
                                      " SG_ u : 0|8@1+ (1,0) [0|1] \"rpm A\n"
                                      " SG_ v : 8|8@1+ (1,0) [0|1] \"\" A\n"
                                      "CM_ \"to the end of the file");
  EXPECT_EQ(result.database.messages.size(), 2U);
  EXPECT_EQ(result.database.messages[0].comment, "never closed ");
  EXPECT_EQ(signal(result, "s").comment, "closed");
  EXPECT_EQ(result.database.messages[1].signals.size(), 2U);
  EXPECT_EQ(result.database.comment, "to the end of the file");
  std::size_t errors = 0;
  for (const Problem& problem : result.problems) {
    errors += problem.severity == Severity::kError ? 1 : 0;
  }
  EXPECT_GE(errors, 4U);
}

TEST(DbcParser, SourceCommentsAreKept) {
  const DbcParseResult result = parse(
      "/* head\n of the file */\n"
      "BU_: A // nodes\n"
      "BO_ 291 M: 8 A // a message\n"
      "// between\n"
      " SG_ s : 0|8@1+ (1,0) [0|1] \"u//v\" A /* behind */\n"
      "CM_ BO_ /* inside */ 291 \"/* text */\";\n"
      "/* without end\n"
      "BO_ 5 N: 8 A\n");
  EXPECT_EQ(places(result),
            "1:1 source-comment, 3:8 source-comment, 4:16 source-comment, 5:1 source-comment, "
            "6:38 source-comment, 7:9 source-comment, 8:1 unclosed-comment, 9:1 section-order");
  EXPECT_EQ(result.database.messages.size(), 2U);
  EXPECT_EQ(signal(result, "s").unit, "u//v");
  EXPECT_EQ(result.database.messages[0].comment, "/* text */");
  ASSERT_EQ(result.database.source_comments.size(), 7U);
  EXPECT_EQ(result.database.source_comments[3].text, "// between");
  EXPECT_EQ(result.database.source_comments[3].line, 5U);
}

// --- signals -------------------------------------------------------------------------------------

TEST(DbcParser, NumbersOfEveryKind) {
  const DbcParseResult result = parse(
      kNodes +
      "BO_ 1 M: 8 A\n"
      " SG_ s : 0|8@1+ (1.5E-003,-2e+2) [-1.7976931348623157e308|18446744073709551615] \"\" A\n"
      " SG_ t : 8|8@1+ (.5,5.) [+3|1e400] \"\" A\n"
      " SG_ u : 0x10|0x8@1+ (0x2,0) [0|1] \"\" A\n"
      "VAL_ 1 s 18446744073709551615 \"max\" -9223372036854775808 \"min\" 0x1F \"hex\" 2.0 \"two\" "
      ";\n");
  EXPECT_EQ(codes(result), "");
  EXPECT_EQ(signal(result, "s").scale, 0.0015);
  EXPECT_EQ(signal(result, "s").offset, -200.0);
  EXPECT_EQ(signal(result, "s").usage->maximum, 18446744073709551616.0);
  EXPECT_EQ(signal(result, "t").scale, 0.5);
  EXPECT_EQ(signal(result, "t").usage->maximum, std::numeric_limits<double>::infinity());
  EXPECT_EQ(signal(result, "u").start_bit, 16U);
  EXPECT_EQ(signal(result, "s").values.size(), 4U);
  EXPECT_EQ(signal(result, "s").values.at(-1), "max");
  EXPECT_EQ(signal(result, "s").values.at(31), "hex");
  EXPECT_EQ(codes(parse(kNodes + kMessage + "VAL_ 291 s 1.5 \"half\" 2 \"two\" ;\n")),
            "value-number");
}

// Found by fuzzing: a second sign, and words that std::from_chars takes for numbers.
TEST(DbcParser, TwoSignsOrWordsAreNoNumber) {
  for (const char* number : {"--1", "+-1", "-inf", "nan", "-"}) {
    const DbcParseResult result =
        parse(kNodes + kMessage + "VAL_ 291 s " + number + " \"text\" ;\n");
    EXPECT_TRUE(signal(result, "s").values.empty()) << number;
    EXPECT_EQ(result.database.other_statements.size(), 1U) << number;
  }
}

TEST(DbcParser, KeysOfUnsigned64BitSignalsAreShownUnsigned) {
  const DbcParseResult result = parse(kNodes +
                                      "BO_ 1 M: 8 A\n"
                                      " SG_ s : 0|64@1+ (1,0) [0|1] \"\" A\n"
                                      "VAL_ 1 s 18446744073709551615 \"max\" ;\n");
  EXPECT_EQ(value_key_text(signal(result, "s"), -1), "18446744073709551615");
}

TEST(DbcParser, OverlappingAndOverhangingSignals) {
  const DbcParseResult result = parse(kNodes +
                                      "BO_ 1 M: 2 A\n"
                                      " SG_ a : 0|8@1+ (1,0) [0|1] \"\" A\n"
                                      " SG_ b : 7|2@1+ (1,0) [0|1] \"\" A\n"
                                      " SG_ c : 9|8@1+ (1,0) [0|1] \"\" A\n"
                                      " SG_ d : 0|2@0+ (1,0) [0|1] \"\" A\n"
                                      " SG_ e : 32|0@1+ (1,0) [0|1] \"\" A\n"
                                      " SG_ f : 32|65@1+ (1,0) [0|1] \"\" A\n"
                                      " SG_ g : 20|4@1+ (0,0) [1|0] \"\" A\n");
  EXPECT_EQ(places(result),
            "4:6 overlap, 5:6 overhang, 6:6 overlap, 7:6 signal-length, 8:6 signal-length, "
            "9:6 overhang, 9:6 factor-zero, 9:6 range-reversed");
  EXPECT_EQ(only_message(result).signals.size(), 7U);
}

TEST(DbcParser, MultiplexedSignalsOverlapOnlyIfAFrameCanCarryBoth) {
  const std::string head = kNodes +
                           "BO_ 1 M: 8 A\n"
                           " SG_ mux M : 0|8@1+ (1,0) [0|1] \"\" A\n"
                           " SG_ a m0 : 8|8@1+ (1,0) [0|1] \"\" A\n"
                           " SG_ b m1 : 8|8@1+ (1,0) [0|1] \"\" A\n";
  EXPECT_EQ(codes(parse(head)), "");
  EXPECT_EQ(places(parse(head + " SG_ c m1 : 12|8@1+ (1,0) [0|1] \"\" A\n")), "6:6 overlap");
  EXPECT_EQ(places(parse(head + " SG_ c : 12|8@1+ (1,0) [0|1] \"\" A\n")), "6:6 overlap");
  EXPECT_EQ(codes(parse(head + "SG_MUL_VAL_ 1 b mux 1-5;\nSG_MUL_VAL_ 1 a mux 0-0, 5-7;\n")),
            "overlap");
  // Through a selector further up.
  EXPECT_EQ(codes(parse(kNodes + "BO_ 1 M: 8 A\n"
                                 " SG_ top M : 0|8@1+ (1,0) [0|1] \"\" A\n"
                                 " SG_ left m0M : 8|8@1+ (1,0) [0|1] \"\" A\n"
                                 " SG_ leaf m3 : 16|8@1+ (1,0) [0|1] \"\" A\n"
                                 " SG_ right m1 : 16|8@1+ (1,0) [0|1] \"\" A\n"
                                 "SG_MUL_VAL_ 1 left top 0-0;\n"
                                 "SG_MUL_VAL_ 1 leaf left 3-3;\n"
                                 "SG_MUL_VAL_ 1 right top 1-1;\n")),
            "");
}

TEST(DbcParser, MultiplexingThatDoesNotAddUp) {
  const std::string head = kNodes + "BO_ 1 M: 8 A\n";
  const std::string a = " SG_ a m0 : 8|8@1+ (1,0) [0|1] \"\" A\n";
  const std::string mux = " SG_ mux M : 0|8@1+ (1,0) [0|1] \"\" A\n";
  const std::string mux2 = " SG_ mux2 M : 16|8@1+ (1,0) [0|1] \"\" A\n";
  const DbcParseResult missing = parse(head + a);
  EXPECT_EQ(places(missing), "3:6 mux-missing");
  EXPECT_FALSE(signal(missing, "a").multiplexed_by);
  const DbcParseResult two = parse(head + mux + mux2 + a);
  EXPECT_EQ(codes(two), "mux-ambiguous");
  EXPECT_FALSE(signal(two, "a").multiplexed_by);
  const DbcParseResult said = parse(head + mux + mux2 + a + "SG_MUL_VAL_ 1 a mux2 4-4;\n");
  EXPECT_EQ(codes(said), "");
  EXPECT_EQ(signal(said, "a").multiplexed_by->selector, "mux2");
  EXPECT_EQ(codes(parse(head + mux + a + "SG_MUL_VAL_ 1 a nobody 4-4;\n")), "unknown-signal");
  EXPECT_EQ(
      codes(parse(head + mux + mux2 + a + "SG_MUL_VAL_ 1 a mux 4-4;\nSG_MUL_VAL_ 1 a mux2 4-4;\n")),
      "mux-two-selectors");
  // The multiplexer itself marked with m and no number, as real files have it.
  const DbcParseResult bare =
      parse(head + " SG_ mux m : 0|8@1+ (1,0) [0|1] \"\" A\n" + a + "SG_MUL_VAL_ 1 a mux 0-0;\n");
  EXPECT_EQ(codes(bare), "mux-number mux-selector");
  EXPECT_EQ(signal(bare, "a").multiplexed_by->selector, "mux");
  EXPECT_FALSE(signal(bare, "mux").multiplexed_by);
  const DbcParseResult circle = parse(head + " SG_ x m0M : 0|8@1+ (1,0) [0|1] \"\" A\n" +
                                      " SG_ y m0M : 8|8@1+ (1,0) [0|1] \"\" A\n" +
                                      "SG_MUL_VAL_ 1 x y 0-0;\nSG_MUL_VAL_ 1 y x 0-0;\n");
  EXPECT_EQ(codes(circle), "mux-circle");
}

TEST(DbcParser, FloatTypes) {
  const std::string head = kNodes +
                           "BO_ 1 M: 64 A\n"
                           " SG_ half : 0|16@1- (1,0) [0|1] \"\" A\n"
                           " SG_ single : 32|32@1- (1,0) [0|1] \"\" A\n"
                           " SG_ twice : 64|64@1- (1,0) [0|1] \"\" A\n"
                           " SG_ odd : 128|24@1- (1,0) [0|1] \"\" A\n"
                           "BA_DEF_ BO_ \"VFrameFormat\" ENUM \"StandardCAN\",\"StandardCAN_FD\";\n"
                           "BA_ \"VFrameFormat\" BO_ 1 1;\n";
  const DbcParseResult result = parse(head +
                                      "SIG_VALTYPE_ 1 half : 1;\nSIG_VALTYPE_ 1 single 1;\n"
                                      "SIG_VALTYPE_ 1 twice : 2;\nSIG_VALTYPE_ 1 odd : 1;\n");
  EXPECT_EQ(codes(result), "value-type");
  EXPECT_EQ(signal(result, "half").type, ValueType::kFloat32);
  EXPECT_EQ(signal(result, "single").type, ValueType::kFloat32);
  EXPECT_EQ(signal(result, "twice").type, ValueType::kFloat64);
  EXPECT_EQ(signal(result, "odd").type, ValueType::kSigned);
  const DbcParseResult crossed =
      parse(head + "SIG_VALTYPE_ 1 single : 2;\nSIG_VALTYPE_ 1 twice : 1;\n");
  EXPECT_EQ(codes(crossed), "value-type value-type");
  EXPECT_EQ(signal(crossed, "single").type, ValueType::kFloat32);
  EXPECT_EQ(signal(crossed, "twice").type, ValueType::kFloat64);
}

TEST(DbcParser, SignalLinesWithPartsMissing) {
  const DbcParseResult result = parse(kNodes +
                                      "BO_ 1 M: 8 A\n"
                                      " SG_ a : 0|8@1+ (1,0)\n"
                                      " SG_ b : 8|8@1+ (1,0) [0|1]\n"
                                      " SG_ c : 16|8@1+ (1,0) [0|1] \"\"\n"
                                      " SG_ d : 24|8@1 (1,0) [0|1] \"\" A\n"
                                      " SG_ e : 32|8@1+ (1,0) [0|1] \"\" A ;\n"
                                      " SG_ f : 40|8@1+ (1,0) [0..1] \"\" A\n");
  EXPECT_EQ(places(result),
            "3:22 signal-incomplete, 4:28 signal-incomplete, 5:32 receiver, 6:17 sign, "
            "7:35 stray-semicolon, 8:27 signal-incomplete");
  EXPECT_EQ(only_message(result).signals.size(), 6U);
  ASSERT_EQ(result.database.other_statements.size(), 1U);
}

TEST(DbcParser, SignalLinesThatCannotBeReadAreErrorsAndTheRestStands) {
  const DbcParseResult result = parse(kNodes +
                                      "BO_ 1 M: 8 A\n"
                                      " SG_ a 0|8@1+ (1,0) [0|1] \"\" A\n"
                                      " SG_ b : x|8@1+ (1,0) [0|1] \"\" A\n"
                                      " SG_ c : 0|8@2+ (1,0) [0|1] \"\" A\n"
                                      " SG_ d : 0|8@1+ (1;0) [0|1] \"\" A\n"
                                      " SG_ e : -1|8@1+ (1,0) [0|1] \"\" A\n"
                                      " SG_ f : 0|8\n"
                                      " SG_\n"
                                      " SG_ good : 0|8@1+ (1,0) [0|1] \"\" A\n");
  EXPECT_EQ(places(result),
            "3:9 syntax, 4:10 syntax, 5:14 syntax, 6:19 syntax, 7:10 syntax, 8:13 syntax, 9:5 "
            "syntax");
  EXPECT_EQ(only_message(result).signals.size(), 1U);
  EXPECT_EQ(result.database.other_statements.size(), 7U);
  EXPECT_EQ(codes(parse("SG_ s : 0|8@1+ (1,0) [0|1] \"\" A\nBO_ 1 M: 8 Vector__XXX\n")),
            "signal-without-message");
}

TEST(DbcParser, MessageLinesWithPartsMissing) {
  EXPECT_EQ(places(parse("BO_ 1 M: 8\nBO_ 2 N : 8 Vector__XXX;\nBO_ 3 O 8 Vector__XXX\n")),
            "1:11 transmitter, 3:9 colon");
  EXPECT_EQ(places(parse("BO_ 1 M: 8 Vector__XXX more text\n")), "1:24 trailing-text");
  EXPECT_EQ(places(parse("BO_ 1 M: x Vector__XXX\nBO_ : 8\nBO_ 2 N: 8 Vector__XXX\n")),
            "1:10 syntax, 2:5 syntax");
  EXPECT_EQ(codes(parse("BO_ 1 M: 9 Vector__XXX\n")), "message-length");
}

// --- statements that refer to something ----------------------------------------------------------

TEST(DbcParser, ReferencesToNothingAreKeptAsText) {
  const DbcParseResult result = parse(kNodes + kMessage +
                                      "CM_ BO_ 5 \"c\";\n"
                                      "CM_ SG_ 291 x \"c\";\n"
                                      "CM_ SG_ 291 \"without a name\";\n"
                                      "CM_ BU_ Z \"c\";\n"
                                      "VAL_ 291 x 0 \"a\" ;\n"
                                      "VAL_ 291 s NoTable ;\n"
                                      "BA_ \"Undefined\" BO_ 291 5;\n"
                                      "SIG_VALTYPE_ 7 x : 1;\n"
                                      "BO_TX_BU_ 7 : A;\n"
                                      "SIG_GROUP_ 7 g 1 : s;\n"
                                      "ENVVAR_DATA_ E : 5;\n");
  EXPECT_EQ(codes(result),
            "unknown-message unknown-signal object-name unknown-node unknown-signal unknown-table "
            "undefined-attribute unknown-message unknown-message unknown-message unknown-variable");
  EXPECT_EQ(result.database.other_statements.size(), 10U);
  EXPECT_EQ(result.database.other_statements[2].text, "CM_ SG_ 291 \"without a name\";");
  EXPECT_EQ(result.database.messages[0].attributes.at("Undefined"), "5");
}

TEST(DbcParser, RepeatedStatements) {
  const DbcParseResult result = parse(kNodes + kMessage +
                                      "CM_ \"one \";CM_ \"two\";\n"
                                      "CM_ BO_ 291 \"one\";\nCM_ BO_ 291 \"two\";\n"
                                      "VAL_ 291 s 0 \"a\" 1 \"b\" ;\nVAL_ 291 s 0 \"c\" ;\n"
                                      "VAL_ 291 t 0 \"a\" 0 \"b\" ;\nVAL_ 291 t ;\n"
                                      "BA_DEF_ BO_ \"X\" INT 0 9;\n"
                                      "BA_ \"X\" BO_ 291 1;\nBA_ \"X\" BO_ 291 2;\n");
  EXPECT_EQ(codes(result),
            "duplicate-comment duplicate-values duplicate-value duplicate-attribute");
  EXPECT_EQ(result.database.comment, "one two");
  EXPECT_EQ(result.database.messages[0].comment, "one\ntwo");
  EXPECT_EQ(signal(result, "s").values.size(), 1U);
  EXPECT_EQ(signal(result, "t").values.at(0), "b");
  EXPECT_EQ(result.database.messages[0].attributes.at("X"), "2");
}

TEST(DbcParser, ValuesByTheNameOfATable) {
  const DbcParseResult result = parse("VAL_TABLE_ T 0 \"a\" 1 \"b\" ;\n" + std::string(kMessage) +
                                      "VAL_ 291 s T ;\n" + kNodes);
  EXPECT_EQ(places(result), "6:1 section-order");
  EXPECT_EQ(signal(result, "s").values.at(1), "b");
}

TEST(DbcParser, StatementsThatAreMereTextAreKept) {
  const DbcParseResult result = parse(kNodes + kMessage +
                                      "SGTYPE_ T : 8@1+ (1,0) [0|1] \"\" 0,;\n"
                                      "SIG_TYPE_REF_ 291 s : T;\n"
                                      "CAT_DEF_ 1 \"c\" 0;\n"
                                      "FILTER x;\n"
                                      "FUTURE_ 1 2 \"three; four\"\n  five;\n"
                                      "CM_ \"behind\";\n");
  EXPECT_EQ(places(result), "9:1 unknown-statement");
  ASSERT_EQ(result.database.other_statements.size(), 5U);
  EXPECT_EQ(result.database.other_statements[4].text, "FUTURE_ 1 2 \"three; four\"\n  five;");
  EXPECT_EQ(result.database.other_statements[4].line, 9U);
  EXPECT_EQ(result.database.comment, "behind");
}

TEST(DbcParser, MissingSemicolonsAndTrailingText) {
  const DbcParseResult result = parse(kNodes + kMessage +
                                      "CM_ BO_ 291 \"c\"\n"
                                      "VAL_ 291 s 0 \"a\" 1 \"b\"\n"
                                      "BA_DEF_ BO_ \"X\" INT 0 9\n"
                                      "BA_ \"X\" BO_ 291 5 6;\n"
                                      ";\n"
                                      "BA_ \"X\" SG_ 291 s word;\n"
                                      "BO_TX_BU_ 291 : A B\n");
  EXPECT_EQ(codes(result),
            "semicolon semicolon semicolon trailing-text stray-semicolon unquoted-value semicolon");
  EXPECT_EQ(result.database.messages[0].comment, "c");
  EXPECT_EQ(signal(result, "s").values.size(), 2U);
  EXPECT_EQ(result.database.messages[0].attributes.at("X"), "5");
  EXPECT_EQ(signal(result, "s").attributes.at("X"), "word");
}

// --- what attributes mean ------------------------------------------------------------------------

struct FormatCase {
  const char* definition;
  const char* value;  // of the message, or empty
  bool fd;
  bool j1939;
};

TEST(DbcParser, FrameFormats) {
  const char* usual =
      "BA_DEF_ BO_ \"VFrameFormat\" ENUM \"StandardCAN\",\"ExtendedCAN\",\"reserved\",\"J1939PG\","
      "\"r\",\"r\",\"r\",\"r\",\"r\",\"r\",\"r\",\"r\",\"r\",\"r\",\"StandardCAN_FD\","
      "\"ExtendedCAN_FD\";\n";
  const std::string with_default =
      std::string(usual) + "BA_DEF_DEF_ \"VFrameFormat\" \"J1939PG\";\n";
  const char* short_list =
      "BA_DEF_ BO_ \"VFrameFormat\" ENUM "
      "\"StandardCAN\",\"ExtendedCAN\",\"StandardCAN_FD\",\"ExtendedCAN_FD\",\"J1939PG\";\n";
  const char* number = "BA_DEF_ BO_ \"VFrameFormat\" INT 0 15;\n";
  const char* number_default =
      "BA_DEF_ BO_ \"VFrameFormat\" INT 0 15;\nBA_DEF_DEF_ \"VFrameFormat\" 3;\n";
  const char* protocol =
      "BA_DEF_ \"ProtocolType\" STRING;\nBA_ \"ProtocolType\" \"J1939\";\n"
      "BA_DEF_ BO_ \"VFrameFormat\" ENUM \"StandardCAN\",\"ExtendedCAN\";\n"
      "BA_DEF_DEF_ \"VFrameFormat\" \"StandardCAN\";\n";
  for (const FormatCase& c :
       {FormatCase{usual, "1", false, false}, FormatCase{usual, "3", false, true},
        FormatCase{usual, "15", true, false}, FormatCase{usual, "\"ExtendedCAN_FD\"", true, false},
        FormatCase{with_default.c_str(), "", false, true},
        FormatCase{with_default.c_str(), "1", false, false},
        FormatCase{short_list, "4", false, true}, FormatCase{short_list, "3", true, false},
        FormatCase{number, "14", true, false}, FormatCase{number, "0", false, false},
        FormatCase{number_default, "", false, true}, FormatCase{protocol, "", false, true},
        FormatCase{protocol, "1", false, false}}) {
    std::string text = "BO_ 2566844672 M: 8 Vector__XXX\n" + std::string(c.definition);
    if (*c.value != '\0')
      text += "BA_ \"VFrameFormat\" BO_ 2566844672 " + std::string(c.value) + ";\n";
    const DbcParseResult result = parse(text);
    EXPECT_EQ(only_message(result).fd, c.fd) << text;
    EXPECT_EQ(only_message(result).j1939, c.j1939) << text;
  }
}

TEST(DbcParser, FilesWhose29BitIdentifiersAllHaveTheNullSourceMeanParameterGroups) {
  const std::string group = "BO_ 2566844926 CCVS1: 8 Vector__XXX\n";
  const std::string node = "BO_ 2566844672 M: 8 Vector__XXX\n";
  EXPECT_TRUE(parse(group).database.messages[0].j1939);
  EXPECT_TRUE(parse(group + "BO_ 100 S: 8 Vector__XXX\n").database.messages[0].j1939);
  EXPECT_FALSE(parse(group + "BO_ 100 S: 8 Vector__XXX\n").database.messages[1].j1939);
  EXPECT_FALSE(parse(group + node).database.messages[0].j1939);
  EXPECT_FALSE(parse(group + "BA_DEF_ \"ProtocolType\" STRING;\nBA_ \"ProtocolType\" \"GMLAN\";\n")
                   .database.messages[0]
                   .j1939);
}

TEST(DbcParser, CycleTimes) {
  const std::string head =
      "BO_ 1 M: 8 Vector__XXX\nBA_DEF_ BO_ \"GenMsgCycleTime\" FLOAT 0 1000;\n";
  EXPECT_FALSE(parse(head).database.messages[0].cycle_ms);
  EXPECT_EQ(parse(head + "BA_DEF_DEF_ \"GenMsgCycleTime\" 100;\n").database.messages[0].cycle_ms,
            100.0);
  const std::string both = head + "BA_DEF_DEF_ \"GenMsgCycleTime\" 100;\n";
  EXPECT_EQ(parse(both + "BA_ \"GenMsgCycleTime\" BO_ 1 2.5;\n").database.messages[0].cycle_ms,
            2.5);
  EXPECT_FALSE(parse(both + "BA_ \"GenMsgCycleTime\" BO_ 1 0;\n").database.messages[0].cycle_ms);
  EXPECT_FALSE(parse(both + "BA_ \"GenMsgCycleTime\" BO_ 1 -5;\n").database.messages[0].cycle_ms);
  EXPECT_FALSE(
      parse(both + "BA_ \"GenMsgCycleTime\" BO_ 1 1e999;\n").database.messages[0].cycle_ms);
}

// --- whatever the input --------------------------------------------------------------------------

TEST(DbcParser, NothingReadableIsOneError) {
  for (const std::string& text :
       {std::string(), std::string("\n\n"), std::string("hello"), std::string(1000, '\0'),
        std::string("\xFF\xFE"), std::string("\x89PNG\r\n\x1A\n\0\0", 10)}) {
    const DbcParseResult result = parse(text);
    EXPECT_TRUE(result.database.messages.empty());
    ASSERT_FALSE(result.problems.empty());
    EXPECT_EQ(result.problems.back().code, "no-message");
    EXPECT_EQ(result.problems.back().severity, Severity::kError);
  }
}

TEST(DbcParser, EveryPrefixOfAFileIsRead) {
  const std::string text = kNodes + kMessage +
                           "CM_ SG_ 291 s \"a \\\"b\\\" \";\n"
                           "BA_DEF_ BO_ \"X\" ENUM \"a\",\"b\";\n"
                           "BA_ \"X\" BO_ 291 1;\n"
                           "VAL_ 291 s 0 \"zero\" 1 \"one\" ;\n"
                           "EV_ E: 0 [0|1] \"\" 0 1 DUMMY_NODE_VECTOR0 A;\n"
                           "SG_MUL_VAL_ 291 t s 3-3, 5-10;\n"
                           "/* c */ // d\n";
  for (std::size_t length = 0; length <= text.size(); ++length) {
    const DbcParseResult result = parse(text.substr(0, length));
    EXPECT_LE(result.database.messages.size(), 1U);
  }
}

// Processor time for an input and for the same of eight times its size: linear means a factor near
// 8, a quadratic step 64. Short times are not compared.
class Linear : public ::testing::TestWithParam<std::pair<const char*, const char*>> {};

double seconds_for(const std::string& text) {
  double best_s = 1e9;
  for (int i = 0; i < 2; ++i) {
    const std::clock_t begin = std::clock();
    static_cast<void>(parse(text));
    best_s = std::min(best_s, static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
  }
  return best_s;
}

TEST_P(Linear, InTheTextWhateverItHolds) {
  const auto& [first, repeated] = GetParam();
  const auto text = [&](std::size_t bytes) {
    std::string all = first;
    for (std::size_t i = 0; all.size() < bytes; ++i) {
      std::string piece = repeated;
      for (std::size_t at = 0; (at = piece.find('#', at)) != std::string::npos;) {
        piece.replace(at, 1, std::to_string(i));
      }
      all += piece;
    }
    return all;
  };
  constexpr std::size_t kSmall = 32 * 1024;
  const double small_s = seconds_for(text(kSmall));
  const double large_s = seconds_for(text(8 * kSmall));
  constexpr double kShort_s = 0.1;
  EXPECT_TRUE(large_s < kShort_s || large_s < 40.0 * small_s)
      << small_s << " s and " << large_s << " s";
}

INSTANTIATE_TEST_SUITE_P(
    Inputs, Linear,
    ::testing::Values(
        std::pair{"", "BO_ # M#: 8 A\n SG_ s : 0|8@1+ (1,0) [0|1] \"\" A\n"},
        std::pair{"", "BO_ 1 M: 8 A\n"},
        std::pair{"BO_ 1 M: 8 A\n", "BO_ 1 M: 8 A\nBA_ \"X\" BO_ 1 5;\nCM_ BO_ 1 \"c\";\n"},
        std::pair{"BO_ 1 M: 8 A\n", "SG_ s : 0|8@1+ (1,0) [0|1] \"\" A\nCM_ SG_ 1 s \"c\";\n"},
        std::pair{"BO_ 1 M: 8 A\n", "SG_ s# : #|8@1+ (1,0) [0|1] \"\" A\nCM_ SG_ 1 s# \"c\";\n"},
        std::pair{"BO_ 1 M: 8 A\nSG_ x M : 0|8@1+ (1,0) [0|1] \"\" A\n",
                  "SG_ s# m# : 8|8@1+ (1,0) [0|1] \"\" A\n"},
        std::pair{"BO_ 1 M: 8 A\nSG_ x M : 0|8@1+ (1,0) [0|1] \"\" A\n",
                  "SG_ s# m#M : 8|8@1+ (1,0) [0|1] \"\" A\nSG_MUL_VAL_ 1 s# x #-#;\n"},
        std::pair{"", "CM_ \""}, std::pair{"", "CM_ \"\n"}, std::pair{"", "CM_ \"\\\"\nBO_ \n"},
        std::pair{"", "VAL_ 1 s 0 \"a\n"}, std::pair{"", "SG_ s : 0|8@1+ (1,0) [0|1] \"\n"},
        std::pair{"BO_ 1 M: 8 A\n", "SG_ s : 0|8@1+ (1,0) [0|1] \""}, std::pair{"CM_ \"", "\" "},
        std::pair{"", ";EV_ E: 0 [0|1] \""}, std::pair{"", "CM_ //x;"}, std::pair{"", "CM_ /*x;"},
        std::pair{"VAL_ 1 s ", "0 \"a\" "}, std::pair{"VAL_ 1 s ", "# \"a\" "}, std::pair{"", "/*"},
        std::pair{"", "//"}, std::pair{"", "/* */"}, std::pair{"", ";"}, std::pair{"", "x"},
        std::pair{"", "x "}, std::pair{"", "x;"}, std::pair{"", "x\n"}, std::pair{"", "BO_"},
        std::pair{"", "BO_ 1 a b\n"}, std::pair{"BU_: ", "n "}, std::pair{"BU_: ", "n#\n"},
        std::pair{"BU_: ", "n#\nx:\n"}, std::pair{"NS_ : ", "CM_\n"}, std::pair{"", "NS_ :\n"},
        std::pair{"BO_ 1 M: 8 ", "A"},
        std::pair{"BO_ 1 M: 8 A\nSG_ s : 0|8@1+ (1,0) [0|1] \"\" ", "A,\n"},
        std::pair{"BO_ 1 M: 8 A\nSG_ ", "s "}, std::pair{"BA_DEF_ \"X\" ENUM ", "\"a\","},
        std::pair{"BA_DEF_ \"X\" ENUM ", "\"\""},
        std::pair{"VAL_TABLE_ T 0 \"aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa\" 1 \"b\" ;\n"
                  "BO_ 1 M: 8 A\nSG_ s : 0|8@1+ (1,0) [0|1] \"\" A\n",
                  "VAL_ 1 s T ;\n"},
        std::pair{"BO_ 1 M: 8 A\n", "SG_MUL_VAL_ 1 s x 0-1, 2-3;\n"},
        std::pair{"BO_ 1 M: 8 A\nSG_ s : 0|8@1+ (1,0) [0|1] \"\" A\nSG_MUL_VAL_ 1 s s ", "0-1, "}));

TEST(DbcParser, KeywordsAsNames) {
  const DbcParseResult result = parse(
      kNodes +
      "BO_ 1 VAL_: 8 A\n SG_ SG_ M : 0|8@1+ (1,0) [0|1] \"\" A\n SG_ BO_ m0 : 8|8@1+ (1,0) [0|1] "
      "\"\" A\nVAL_ 1 BO_ 0 \"zero\" ;\nCM_ SG_ 1 SG_ \"selector\";\n");
  EXPECT_EQ(codes(result), "name-keyword name-keyword name-keyword");
  ASSERT_EQ(result.database.messages.size(), 1U);
  const MessageDef& message = result.database.messages[0];
  EXPECT_EQ(message.name, "VAL_");
  ASSERT_EQ(message.signals.size(), 2U);
  EXPECT_EQ(message.signals[0].comment, "selector");
  EXPECT_EQ(message.signals[1].values.at(0), "zero");
  // On a line of its own a keyword is a statement, and the one before has no name.
  EXPECT_EQ(codes(parse(kNodes + "BO_ 1\nBO_ 2 M: 8 A\n")), "syntax");
}

TEST(DbcParser, GroupsThatNameASignalThatIsNotThere) {
  const DbcParseResult result = parse(kNodes + kMessage + "SIG_GROUP_ 291 G 1 : s nope;\n");
  EXPECT_EQ(codes(result), "unknown-signal");
  EXPECT_EQ(result.database.messages[0].groups[0].signals.size(), 2U);
}

TEST(DbcParser, BytesOfValueZeroAreBlanksAndSaidOnce) {
  std::string text = "BS_:\n" + kNodes + kMessage;
  text.replace(text.find("BO_ 291") + 3, 1, 1, '\0');
  const DbcParseResult result = parse(text + std::string(1000, '\0'));
  EXPECT_EQ(places(result), "3:4 nul-byte");
  EXPECT_EQ(only_message(result).signals.size(), 2U);
}

TEST(DbcParser, SemicolonBehindASignal) {
  EXPECT_EQ(places(parse(kNodes + "BO_ 1 M: 8 A\n SG_ s : 0|8@1+ (1,0) [0|1] \"\" A ;\n")),
            "3:34 stray-semicolon");
}

TEST(DbcParser, ARunOfSemicolonsIsOneOddity) {
  EXPECT_EQ(places(parse(kNodes + kMessage + ";;; ;\n;\nCM_ \"c\";;")),
            "5:1 stray-semicolon, 7:9 stray-semicolon");
}

// As in public files that a generator was fed with its own output.
TEST(DbcParser, AStrayQuoteBehindNodesAndReceiversCostsNothing) {
  const DbcParseResult nodes = parse("BU_: A B XX\";\nBO_ 1 M: 8 B\n");
  EXPECT_EQ(places(nodes), "1:12 node-list");
  EXPECT_EQ(nodes.database.nodes, (std::vector<Text>{"A", "B", "XX"}));
  ASSERT_EQ(nodes.database.other_statements.size(), 1U);
  EXPECT_EQ(nodes.database.other_statements[0].text, "\"");
  EXPECT_EQ(parse("BU_: A (B) [C\nBO_ 1 M: 8 B\n").database.nodes,
            (std::vector<Text>{"A", "B", "C"}));

  const DbcParseResult receivers =
      parse(kNodes + "BO_ 1 M: 8 A\n SG_ s : 0|8@1+ (1,0) [0|1] \"\" B\";\n");
  EXPECT_EQ(places(receivers), "3:33 signal-incomplete");
  EXPECT_EQ(signal(receivers, "s").unit, "");
  EXPECT_EQ(signal(receivers, "s").usage->receivers, std::vector<Text>{"B"});
  // With receivers behind the last quote, the others are the unit's.
  const DbcParseResult inch =
      parse(kNodes + "BO_ 1 M: 8 A\n SG_ s : 0|8@1+ (1,0) [0|1] \"12\" pipe\" B\n");
  EXPECT_EQ(places(inch), "3:29 quote-in-text");
  EXPECT_EQ(signal(inch, "s").unit, "12\" pipe");
}

TEST(DbcParser, ARangeThatEndsBeforeItStartsIsSaid) {
  const DbcParseResult result = parse(
      kNodes +
      "BO_ 1 M: 8 A\n SG_ s M : 0|8@1+ (1,0) [0|1] \"\" A\n SG_ t m5 : 8|8@1+ (1,0) [0|1] \"\" A\n"
      "SG_MUL_VAL_ 1 t s 1-1, 5-3;\n");
  EXPECT_EQ(places(result), "5:24 mux-range");
  using Ranges = std::vector<std::pair<std::uint64_t, std::uint64_t>>;
  EXPECT_EQ(signal(result, "t").multiplexed_by->ranges, (Ranges{{1, 1}, {3, 5}}));
}

TEST(DbcParser, AttributesOutsideTheirDefinition) {
  const auto value = [](const std::string& definition, const std::string& text) {
    return codes(parse(kNodes + kMessage + "BA_DEF_ BO_ \"X\" " + definition +
                       ";\nBA_ \"X\" BO_ 291 " + text + ";\n"));
  };
  EXPECT_EQ(value("INT 0 10", "10"), "");
  EXPECT_EQ(value("INT 0 10", "11"), "attribute-range");
  EXPECT_EQ(value("FLOAT -1.5 1.5", "-1.6"), "attribute-range");
  EXPECT_EQ(value("HEX 0 0", "7"), "");  // no range
  EXPECT_EQ(value("ENUM \"a\",\"b\"", "\"b\""), "");
  EXPECT_EQ(value("ENUM \"a\",\"b\"", "\"c\""), "enum-text");
  EXPECT_EQ(codes(parse(kNodes + kMessage +
                        "BA_DEF_ BO_ \"X\" INT 0 1;\nBA_DEF_ SG_ \"X\" INT 0 1;\n"
                        "BA_DEF_ BO_ \"X\" INT 0 2;\n")),
            "duplicate-definition");
}

TEST(DbcParser, AHundredThousandMessages) {
  constexpr std::uint32_t kMessages = 100'000;
  std::string text = "BS_:\n" + kNodes;
  for (std::uint32_t i = 0; i < kMessages; ++i) {
    const std::string number = std::to_string(i);
    text += "BO_ " + std::to_string(0x8000'0000U + i) + " M" + number +
            ": 8 A\n SG_ s : 0|8@1+ (1,0) [0|1] \"\" A\n";
  }
  const DbcParseResult result = parse(text);
  EXPECT_EQ(codes(result), "");
  ASSERT_EQ(result.database.messages.size(), kMessages);
  const Database* database = &result.database;
  const MessageIndex index(std::span<const Database* const>(&database, 1));
  for (std::uint32_t i = 0; i < kMessages; ++i) {
    const MessageIndex::Entry* entry = index.lookup({i, true});
    ASSERT_TRUE(entry != nullptr && entry->message == i);
  }
}

TEST(DbcParser, ATableUsedByNameTooOftenIsRefused) {
  std::string text = kNodes + "VAL_TABLE_ T 0 \"" + std::string(100'000, 'a') + "\" ;\n";
  for (int i = 0; i < 1000; ++i) {
    const std::string number = std::to_string(i);
    text += "BO_ " + number + " M" + number + ": 8 A\n SG_ s : 0|8@1+ (1,0) [0|1] \"\" A\nVAL_ " +
            number + " s T ;\n";
  }
  const DbcParseResult result = parse(text);
  EXPECT_EQ(result.database.messages.size(), 1000U);
  EXPECT_NE(codes(result).find("tables-too-large"), std::string::npos);
  EXPECT_EQ(result.database.messages[0].signals[0].values.size(), 1U);
}

// The size of the table was counted anew at every use: a file of 3 MB took minutes.
TEST(DbcParser, ATableOfManyValuesUsedByNameManyTimesTakesNoTime) {
  std::string text = kNodes + "VAL_TABLE_ T";
  for (int i = 0; i < 50'000; ++i) text += ' ' + std::to_string(i) + " \"x\"";
  text += " ;\n" + std::string(kMessage);
  constexpr std::size_t kUses = 50'000;
  for (std::size_t i = 0; i < kUses; ++i) text += "VAL_ 291 s T ;\n";
  const double elapsed_s = seconds_for(text);
  constexpr double kLimit_s = 3.0;  // 60 s before; the sanitizers need their share
  EXPECT_LT(elapsed_s, kLimit_s);
}

TEST(DbcParser, AMegabyteInOneLineOrNameGivesShortMessages) {
  const std::string long_name(1'000'000, 'n');
  for (const std::string& text :
       {"BO_ 1 " + long_name + ": 8 A\n", "BO_ 1 M: 8 A\n SG_ " + long_name + " : 0|8@1+\n",
        "CM_ BU_ " + long_name + " \"c\";\nBO_ 1 M: 8 A\n", long_name, "VERSION " + long_name}) {
    for (const Problem& problem : parse(text).problems) EXPECT_LT(problem.text.size(), 300U);
  }
}

}  // namespace
}  // namespace beltgrip::can
