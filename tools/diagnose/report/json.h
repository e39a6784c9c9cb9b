// A diagnosis as JSON (one object) and as text for people.
#pragma once

#include <array>
#include <string>

#include "tools/diagnose/data/diagnosis.h"

namespace beltgrip::diagnose {
std::string json_text(const Diagnosis& diagnosis);
std::string verdict_line(const Diagnosis& diagnosis);
// What is left unexplained, as a part of a sentence.
std::string sentence(const Unexplained& left);
std::string sentence(const LearnedFinding& learned);
// What a reader has to know, in one sentence.
std::string headline(const Diagnosis& diagnosis);
std::string plain_text(const Diagnosis& diagnosis);

// What a rerun shows, in the order of every output.
struct RerunFigure {
  const char* key;
  const char* heading;
  double Measured::*value;
};
inline constexpr std::array<RerunFigure, 3> kRerunFigures{
    {{"mu_max", "mu_max", &Measured::mu_max},
     {"slip_stop_percent", "slip at the stop, %", &Measured::slip_stop_percent},
     {"min_clamp_force_N", "MinClampForce, N", &Measured::min_clamp_force_N}}};
std::string figure_text(const Rerun& rerun, const RerunFigure& figure);  // "before -> after"
// What scatter between experiments is judged against.
std::string base_words(const Diagnosis& d);

}  // namespace beltgrip::diagnose
