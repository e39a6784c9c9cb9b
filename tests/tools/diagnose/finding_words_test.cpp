// What a person reads of a finding.
#include "tools/diagnose/report/finding_words.h"

#include <gtest/gtest.h>

#include "tools/diagnose/model/effects/effect.h"
#include "tools/diagnose/report/json.h"

namespace beltgrip::diagnose {
namespace {

TEST(FindingWords, AreThereForEachParameter) {
  for (const EffectRow& row : effect_rows()) {
    for (const double size : {1.0, -1.0}) {
      EXPECT_FALSE(words_of(row.id, row.parameter, size).empty()) << row.id << "." << row.parameter;
    }
  }
}

Finding drag() {
  Finding out;
  out.effect = "torque_loss";
  out.parameters["per_kN_Nm"] = {0.50312, 0.49287, 0.51337};
  return out;
}

TEST(FindingWords, HaveTheSizeWithItsUnitAndNoMoreDigitsThanItKnows) {
  EXPECT_EQ(in_words(drag()),
            "a drag that grows with the clamp force, 0.503 ± 0.01 Nm/kN (torque_loss)");
  Finding lopsided = drag();
  lopsided.parameters["per_kN_Nm"] = {0.5, 0.4, 0.8};
  EXPECT_EQ(in_words(lopsided),
            "a drag that grows with the clamp force, 0.5 (0.4 to 0.8) Nm/kN (torque_loss)");
}

TEST(FindingWords, HaveNoExponentThatNobodyReads) {
  Finding spring;
  spring.effect = "spring_force";
  spring.parameters["force_N"] = {360.0, 250.0, 470.0};
  EXPECT_EQ(in_words(spring),
            "a spring that is stronger than configured by 360 ± 110 N (spring_force)");
  EXPECT_EQ(readable(-1.2345e5, 2), "-120000");
  EXPECT_EQ(readable(999.6, 3), "1000");
  EXPECT_EQ(readable(3e-7, 2), "3e-07");
  EXPECT_EQ(readable(4.2e7, 2), "4.2e+07");
}

TEST(FindingWords, HaveNoSizeInATitle) {
  EXPECT_EQ(words_of("wear", "per_experiment", 0.01), "friction that falls with each experiment");
  EXPECT_EQ(words_of("friction_speed", "per_ln_speed", -0.1),
            "friction that falls with the logarithm of the speed");
  EXPECT_EQ(words_of("friction_load", "exponent", 0.1), "friction that falls with the clamp force");
}

TEST(FindingWords, NameAFileInPlaceOfAnIndex) {
  Finding worn;
  worn.effect = "wear";
  worn.parameters["step"] = {0.05, 0.04, 0.06};
  worn.fixed["at"] = 3;
  worn.from_file = "monday.csv";
  EXPECT_EQ(in_words(worn),
            "less friction from one experiment on, by 5 ± 1 %, from monday.csv on (wear)");
}

TEST(FindingWords, SayTooLowInsteadOfTooHighByLessThanNothing) {
  Finding low;
  low.effect = "pressure_offset";
  low.parameters["offset_Pa"] = {-20000.0, -35000.0, -5000.0};
  EXPECT_EQ(in_words(low),
            "a measured pressure that is too low by 0.2 ± 0.15 bar (pressure_offset)");
  Finding high = low;
  high.parameters["offset_Pa"] = {20000.0, 5000.0, 35000.0};
  EXPECT_EQ(in_words(high),
            "a measured pressure that is too high by 0.2 ± 0.15 bar (pressure_offset)");
}

TEST(FindingWords, TellSignalsInTheirUnits) {
  EXPECT_EQ(told("primary_torque", 0.327), "0.33 Nm");
  EXPECT_EQ(told("secondary_pressure", 123456.0, 3), "1.23 bar");
  EXPECT_EQ(told("torque_gain", -0.031), "-3.1 %");
  EXPECT_EQ(told_change("slip", 8.564e-4, 4.898e-4, 1.371e-4, 5.489e-4),
            "0.08564 -> 0.04898 [0.01371, 0.05489] %");
  EXPECT_EQ(told("what has none", 1.5), "1.5");
}

TEST(Headline, IsOneSentence) {
  Diagnosis d;
  d.verdict = Verdict::kExplained;
  d.findings = {drag()};
  d.mu_max = MuMaxError{0.0114, 0.0007, 0.0, 0.02};
  EXPECT_EQ(headline(d),
            "A drag that grows with the clamp force, 0.503 ± 0.01 Nm/kN (torque_loss) explains "
            "what was wrong; with it mu_max is off by 0.07 % instead of 1.1 %.");
  d.explained_share = 0.958;
  EXPECT_EQ(headline(d),
            "A drag that grows with the clamp force, 0.503 ± 0.01 Nm/kN (torque_loss) explains "
            "96 % of what was wrong; with it mu_max is off by 0.07 % instead of 1.1 %.");
  d.mu_max.reset();
  d.held_out["primary_torque"] = {1.57, 0.33, 1.0, 1.5};
  EXPECT_EQ(headline(d),
            "A drag that grows with the clamp force, 0.503 ± 0.01 Nm/kN (torque_loss) explains "
            "96 % of what was wrong; with it primary_torque is off by 0.33 Nm instead of 1.6 Nm.");
}

TEST(Headline, SaysWhatMayStandInThePlaceOfAFinding) {
  Diagnosis d;
  d.verdict = Verdict::kExplained;
  d.findings = {drag()};
  const std::string drag_text =
      "A drag that grows with the clamp force, 0.503 ± 0.01 Nm/kN (torque_loss)";
  d.findings[0].aliases = {"friction_load"};
  EXPECT_EQ(headline(d), drag_text + ", or friction_load in its place, explains what was wrong.");
  d.findings[0].aliases = {"a", "b", "c", "d"};
  EXPECT_EQ(headline(d),
            drag_text + ", or a or b or c or others in its place, explains what was wrong.");
}

}  // namespace
}  // namespace beltgrip::diagnose
