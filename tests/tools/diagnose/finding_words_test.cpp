// What a person reads of a finding.
#include "tools/diagnose/report/finding_words.h"

#include <gtest/gtest.h>

#include "tools/diagnose/model/effects/effect.h"
#include "tools/diagnose/report/json.h"

namespace beltgrip::diagnose {
namespace {

TEST(FindingWords, AreThereForEachParameter) {
  for (const EffectRow& row : effect_rows()) {
    EXPECT_FALSE(words_of(row.id, row.parameter).empty()) << row.id << "." << row.parameter;
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
            "a drag that grows with the clamp force, 0.503 +- 0.01 Nm/kN (torque_loss)");
  Finding lopsided = drag();
  lopsided.parameters["per_kN_Nm"] = {0.5, 0.4, 0.8};
  EXPECT_EQ(in_words(lopsided),
            "a drag that grows with the clamp force, 0.5 (0.4 to 0.8) Nm/kN (torque_loss)");
}

TEST(FindingWords, NameAFileInPlaceOfAnIndex) {
  Finding worn;
  worn.effect = "wear";
  worn.parameters["step"] = {0.05, 0.04, 0.06};
  worn.fixed["at"] = 3;
  worn.from_file = "monday.csv";
  EXPECT_EQ(in_words(worn),
            "less friction from one experiment on, a share of 0.05 +- 0.01, from monday.csv on "
            "(wear)");
}

TEST(Headline, IsOneSentence) {
  Diagnosis d;
  d.verdict = Verdict::kExplained;
  d.findings = {drag()};
  d.mu_max = MuMaxError{0.0114, 0.0007, 0.0, 0.02};
  EXPECT_EQ(headline(d),
            "A drag that grows with the clamp force, 0.503 +- 0.01 Nm/kN (torque_loss) explains "
            "what was wrong; with it mu_max is off by 0.07 % instead of 1.1 %.");
}

}  // namespace
}  // namespace beltgrip::diagnose
