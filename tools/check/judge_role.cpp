#include "tools/check/judge_role.h"

#include <algorithm>
#include <bit>
#include <cctype>
#include <cmath>
#include <iterator>
#include <vector>

#include "can_dbc/frame/e2e.h"
#include "can_dbc/text/unit_text.h"
#include "daemon/core/config/toml/config_errors.h"
#include "tools/check/text.h"
#include "tools/check/thresholds.h"

namespace beltgrip::check {

namespace {

using daemon::RoleBinding;

class Judge {
 public:
  Judge(const RoleCourse& course, const RoleWatch& watch, const daemon::Config& config,
        const DbcUnits& units)
      : course_(course),
        binding_(*course.binding),
        watch_(watch),
        config_(config),
        units_(units),
        in_unit_(binding_) {}

  Findings run() {
    dbc_unit();
    if (watch_.frames() == 0) return found_;
    if (course_.frames == 0) {
      not_seen();
      return found_;
    }
    kind();
    protection();
    if (course_.values == 0) {
      if (course_.not_selected > 0) {
        wrong(format("the multiplexer selects it in none of %s frames",
                     grouped(static_cast<double>(course_.not_selected)).c_str()));
      }
      return found_;
    }
    range();
    if (course_.in_range == 0) return found_;
    rate();
    gaps();
    answers();
    level();
    course();
    return found_;
  }

 private:
  void add(Weight weight, std::string text) { found_.push_back({weight, std::move(text)}); }
  void wrong(std::string text) { add(Weight::kWrong, std::move(text)); }
  void doubt(std::string text) { add(Weight::kDoubt, std::move(text)); }
  void note(std::string text) { add(Weight::kNote, std::move(text)); }

  std::string count(std::uint64_t some) const {
    return grouped(static_cast<double>(some)) + " of " +
           grouped(static_cast<double>(course_.frames)) + " frames";
  }
  double at(double share) const { return quantile(course_.spread.values(), share); }
  std::string text(double si) const { return in_unit_.text(si); }
  // In the user's unit, and in another one beside it where that is another.
  std::string with_unit(double si, double per_si, const char* unit) const {
    const std::string own = text(si);
    return binding_.unit == unit ? own : own + format(" (%.3g %s)", per_si * si, unit);
  }

  void dbc_unit();
  void not_seen();
  void kind();
  void protection();
  std::string fitting_data_id(const daemon::CrcProtection& crc) const;
  void range();
  void rate();
  void gaps();
  void answers();
  void level();
  void speed_level();
  void torque_in_percent();
  void course();
  bool repeats_itself() const;

  const RoleCourse& course_;
  const RoleBinding& binding_;
  const RoleWatch& watch_;
  const daemon::Config& config_;
  const DbcUnits& units_;
  InUnit in_unit_;
  Findings found_;
};

// The configuration's unit against the DBC's: where both are known and differ, the DBC's is of
// another dimension, or another scale that no `scale` makes up for.
void Judge::dbc_unit() {
  const auto known = units_.find(binding_.role);
  if (known == units_.end() || known->second.empty() || binding_.unit.empty()) return;
  const auto there = can::parse_unit(known->second), here = can::parse_unit(binding_.unit);
  if (!there || !here) return;
  const std::string both =
      "the DBC says \"" + known->second + "\", the configuration \"" + binding_.unit + "\"";
  if (there->dimension != here->dimension) {
    doubt(both + ": a " + std::string(can::dimension_name(there->dimension)) + " read as a " +
          std::string(can::dimension_name(here->dimension)));
  } else if (there->factor != here->factor && binding_.scale == 1.0) {
    doubt(both +
          format(": a factor of %.4g, and no scale makes up for it", here->factor / there->factor));
  }
}

void Judge::not_seen() {
  if (binding_.uds) {
    wrong("no answer of " + id_text(binding_.uds->response) +
          format(" with identifier 0x%04X", unsigned{binding_.uds->identifier}) +
          ": nobody asks, or another address");
    return;
  }
  if (config_.table) {
    std::vector<std::string> names;
    for (const can::MessageDef& column : config_.table->columns.messages) {
      names.push_back(column.name);
    }
    wrong("no column \"" + binding_.signal_name + "\" among the " + std::to_string(names.size()) +
          daemon::nearest_hint(binding_.signal_name, names));
    return;
  }
  std::vector<std::pair<unsigned, std::string>> similar;
  for (const auto& [key, heard] : watch_.census()) {
    const auto& [bus, id] = key;
    const unsigned distance =
        id.value > binding_.id.value ? id.value - binding_.id.value : binding_.id.value - id.value;
    const bool other_kind = id.extended != binding_.id.extended && distance == 0;
    const bool digit = std::popcount(id.value ^ binding_.id.value) == 1;
    if (!other_kind &&
        !(id.extended == binding_.id.extended && (distance <= kSimilarIdDistance || digit))) {
      continue;
    }
    const double span_s = static_cast<double>((heard.last - heard.first).ns()) * 1e-9;
    const double rate_Hz = span_s > 0.0 ? static_cast<double>(heard.frames - 1) / span_s : 0.0;
    similar.emplace_back(
        distance, id_text(id) + format(" (%u bytes, %.0f Hz)", unsigned{heard.length}, rate_Hz) +
                      (bus != binding_.bus ? " on the other bus" : ""));
  }
  std::sort(similar.begin(), similar.end());
  std::string text = "message " + id_text(binding_.id) + " is not among the " +
                     std::to_string(watch_.census().size()) + " identifiers";
  if (similar.empty()) {
    text += ", and none is like it";
  } else {
    text += "; like it: ";
    for (std::size_t i = 0; i < similar.size() && i < kSimilarShown; ++i) {
      text += (i > 0 ? ", " : "") + similar[i].second;
    }
  }
  wrong(text);
}

void Judge::kind() {
  if (course_.wrong_kind == 0) return;
  const std::string text = count(course_.wrong_kind) +
                           format(" have %u bytes or another kind; the DBC says %u bytes",
                                  unsigned{course_.other_length}, binding_.message_length) +
                           (binding_.message_fd ? ", CAN FD" : ", classic");
  course_.wrong_kind * 2 > course_.frames ? wrong(text) : doubt(text);
}

// Which data id makes the CRC of the refused frames right: the identifier itself first, then the
// least. All that fit do the same.
std::string Judge::fitting_data_id(const daemon::CrcProtection& crc) const {
  const auto fits = [&](std::uint16_t data_id) {
    return std::all_of(
        course_.refused.begin(), course_.refused.end(), [&](const can::CanFrame& frame) {
          std::array<std::uint8_t, can::kMaxPayload> others{};
          std::size_t length = 0;
          const auto payload = frame.payload();
          for (std::size_t i = 0; i < payload.size(); ++i) {
            if (i != crc.byte) others[length++] = payload[i];
          }
          return can::e2e::crc_profile1(data_id, {others.data(), length}) == payload[crc.byte];
        });
  };
  const auto own = static_cast<std::uint16_t>(binding_.id.value & 0xFFFF);
  if (fits(own)) return format("data id 0x%04X fits, the message's own identifier", unsigned{own});
  for (std::uint32_t id = 0; id <= 0xFFFF; ++id) {
    if (fits(static_cast<std::uint16_t>(id))) {
      return format("data id 0x%04X fits, and 255 others that do the same", id);
    }
  }
  return "no data id fits: another byte, another polynomial, or other bytes than this profile's";
}

void Judge::protection() {
  const daemon::MessageProtection* mine = nullptr;
  for (const daemon::MessageProtection& each : config_.protections) {
    if (each.id == binding_.id) mine = &each;
  }
  const auto frames = static_cast<double>(course_.frames);
  if (course_.crc_bad > 0 && mine != nullptr && mine->crc) {
    const std::string text = "CRC of " + binding_.message_name + " wrong in " +
                             count(course_.crc_bad) +
                             format(" with data id 0x%04X", unsigned{mine->crc->data_id});
    if (static_cast<double>(course_.crc_bad) > kCrcWrongShare * frames) {
      wrong(text + "; " + fitting_data_id(*mine->crc));
    } else {
      doubt(text + ": a disturbed line, or a second sender");
    }
  }
  if (course_.counter_still > 0) {
    const std::string text =
        "counter of " + binding_.message_name + " stands still in " + count(course_.counter_still) +
        format(
            " (last %u): a frozen sender, another signal is the counter, or each "
            "frame is there twice, as in a log of two interfaces "
            "(--interface takes one)",
            course_.counter_last);
    static_cast<double>(course_.counter_still) > kStillWrongShare* frames ? wrong(text)
                                                                          : doubt(text);
  }
  if (course_.counter_jumps > 0) {
    const double share = static_cast<double>(course_.counter_jumps) / frames;
    const std::string text =
        "counter of " + binding_.message_name + " jumps in " + count(course_.counter_jumps);
    if (share > kCrcWrongShare) {
      wrong(text + ": another signal is the counter, or it counts to another number than " +
            std::to_string(mine != nullptr && mine->counter ? mine->counter->maximum : 15));
    } else {
      doubt(text + ": frames are lost");
    }
  }
}

void Judge::range() {
  if (course_.in_range == course_.values) return;
  const double share = static_cast<double>(course_.in_range) / static_cast<double>(course_.values);
  const std::string text =
      format("%.3g %% of its values are outside the DBC's range", 100.0 * (1.0 - share)) +
      (binding_.minimum < binding_.maximum
           ? format(" (%.6g to %.6g; the last: %.6g)", binding_.minimum, binding_.maximum,
                    course_.out_of_range)
           : " or \"not available\"");
  share < kInRangeLeast ? wrong(text) : doubt(text);
}

void Judge::rate() {
  const double rate_Hz = course_.rate_Hz();
  if (rate_Hz <= 0.0) return;
  if (binding_.period_ms && *binding_.period_ms > 0.0) {
    const double wanted_Hz = 1e3 / *binding_.period_ms;
    if (rate_Hz < kRateSlow * wanted_Hz || rate_Hz > kRateFast * wanted_Hz) {
      doubt(format("comes at %.3g Hz, configuration or DBC say %.3g Hz", rate_Hz, wanted_Hz));
    }
  }
  const bool moves = is_required(binding_.role, config_);
  if (moves && rate_Hz < kRateMeasured * kRateLeast_Hz) {
    doubt(format("comes at %.3g Hz: slower than %.0f Hz tells little of slip", rate_Hz,
                 kRateLeast_Hz));
  }
}

void Judge::gaps() {
  if (course_.silent_s > kSilentLeast_s && course_.silent_s > kSilentPeriods / course_.rate_Hz()) {
    const std::string text =
        course_.silent_from_s == 0.0
            ? format("not in the first %.1f s of the log", course_.silent_s)
            : format("never again after %.1f s, for the last %.1f s of the log",
                     course_.silent_from_s, course_.silent_s);
    doubt(text + ": a node that sleeps, or a cut?");
  }
  if (course_.gap_count == 0) return;
  std::string text =
      format("%llu gap%s, the longest %.2f s", static_cast<unsigned long long>(course_.gap_count),
             course_.gap_count == 1 ? "" : "s", course_.longest_gap_s);
  text += format(", the first at %.1f s", course_.gaps.front().begin_s);
  std::vector<double> between;
  for (std::size_t i = 1; i < course_.gaps.size(); ++i) {
    between.push_back(course_.gaps[i].begin_s - course_.gaps[i - 1].begin_s);
  }
  if (static_cast<int>(between.size()) + 1 >= kRegularGaps) {
    const double usual = quantile(between, 0.5);
    const double least = *std::min_element(between.begin(), between.end());
    const double most = *std::max_element(between.begin(), between.end());
    if (usual > 0.0 && most - least < kRegularScatter * usual) {
      text += format("; one every %.3g s", usual);
    }
  }
  // Of oil and vehicle speed nothing is asked within a second (daemon/core/input/input_stage.h).
  const bool slow = binding_.role == Role::kOilTemperature || binding_.role == Role::kVehicleSpeed;
  slow&& course_.longest_gap_s < 1.0 ? note(text) : doubt(text + ": an experiment ends at each");
}

// How fast diagnostics are, and who sets the pace.
void Judge::answers() {
  if (!binding_.uds) return;
  if (course_.requests == 0) {
    note("nobody's request for it is to be seen: the answers alone");
    return;
  }
  const double every_s = quantile(course_.asked_every_s.values(), 0.5);
  std::string text =
      format("asked for %s times", grouped(static_cast<double>(course_.requests)).c_str());
  if (every_s > 0.0) text += format(", every %.0f ms", 1e3 * every_s);
  const std::vector<double>& answers_s = course_.answers_s.values();
  if (!answers_s.empty()) {
    text += format("; answered after %.0f ms, in the slowest of 100 after %.0f ms",
                   1e3 * quantile(answers_s, 0.5), 1e3 * quantile(answers_s, 0.99));
  }
  note(text);
  if (course_.requests > course_.frames + 1) {
    doubt(format("%s requests for it had no value as answer",
                 grouped(static_cast<double>(course_.requests - course_.frames)).c_str()));
  }
}

void Judge::speed_level() {
  const bool secondary = binding_.role == Role::kSecondarySpeed;
  const double most = secondary ? kSecondaryMost_rad_s : kPrimaryMost_rad_s;
  const double high = at(kNearlyMost), low = at(kNearlyLeast);
  if (high > most) {
    const bool in_rad_s = binding_.unit == "rad/s";
    wrong(text(high) + (in_rad_s ? " (" + grouped(high * kPerMinute) + " 1/min)" : "") +
          ": no such shaft turns so fast; " +
          (in_rad_s ? "1/min read as rad/s?" : "unit or scale?"));
  }
  if (at(0.5) < -kStanding_rad_s) {
    wrong("below zero for most of the time (" + text(at(0.5)) + "): sign?");
  } else if (low < -kStanding_rad_s) {
    note("at times below zero (" + text(course_.least) + "): reverse gear, or the sign?");
  }
  if (!secondary && high > 0.0 && high < kPrimaryLeast_rad_s) {
    doubt("never above " + text(high) + ": slower than an engine runs; rad/s read as 1/min?");
  }
}

// Percent of a reference torque, by what the DBC says of the signal.
void Judge::torque_in_percent() {
  if (binding_.uds || binding_.scale != 1.0) return;
  std::string name = binding_.signal_name;
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const char* const words[] = {"percent", "pct", "prct", "prozent", "pourcent"};
  const bool by_name = std::any_of(std::begin(words), std::end(words), [&](const char* word) {
    return name.find(word) != std::string::npos;
  });
  const auto is_in = [](const auto& ends, double end) {
    return std::find(std::begin(ends), std::end(ends), end) != std::end(ends);
  };
  const bool by_range = binding_.role == Role::kEngineTorque &&
                        is_in(kPercentTops, binding_.maximum) &&
                        is_in(kPercentBottoms, binding_.minimum);
  if (!by_name && !by_range) return;
  const std::string evidence =
      by_name ? "its name is " + binding_.signal_name
              : format("its range in the DBC is %.4g to %.4g", binding_.minimum, binding_.maximum);
  doubt(evidence + ": percent of a reference torque, read as " + binding_.unit +
        "? Then scale is missing");
}

void Judge::level() {
  switch (binding_.role) {
    case Role::kPrimarySpeed:
    case Role::kSecondarySpeed:
    case Role::kEngineSpeed:
      speed_level();
      break;
    case Role::kSecondaryPressure:
    case Role::kPrimaryPressure:
    case Role::kSecondaryPressureCommand:
      if (at(kNearlyMost) > kPressureMost_Pa) {
        wrong(with_unit(at(kNearlyMost), 1e-6, "MPa") +
              ": beyond every CVT's pump; unit or scale?");
      }
      if (at(0.5) < -kPressureLeast_Pa) {
        wrong("below zero for most of the time (" + text(at(0.5)) + "): offset or sign?");
      } else if (at(kNearlyMost) < kPressureLeast_Pa && binding_.role == Role::kSecondaryPressure) {
        wrong("never above " + with_unit(at(kNearlyMost), 1e-3, "kPa") +
              ": no belt is held so; unit?");
      } else if (at(kNearlyMost) < kPressureUsual_Pa && binding_.role == Role::kSecondaryPressure) {
        doubt("never above " + with_unit(at(kNearlyMost), 1e-3, "kPa") +
              ": less than a CVT has at idle (0.1 MPa and more); unit?");
      }
      break;
    case Role::kEngineTorque:
    case Role::kPrimaryTorque:
    case Role::kSecondaryTorque:
      if (std::max(std::abs(at(kNearlyMost)), std::abs(at(kNearlyLeast))) >
          (binding_.role == Role::kSecondaryTorque ? kTorqueMostSecondary_Nm : kTorqueMost_Nm)) {
        wrong("from " + text(at(kNearlyLeast)) + " to " + text(at(kNearlyMost)) +
              ": more than any belt carries; unit or scale?");
      }
      torque_in_percent();
      break;
    case Role::kOilTemperature:
      if (at(0.5) < kOilLeast_degC || at(0.5) > kOilMost_degC) {
        wrong("mostly " + with_unit(at(0.5), 1.0, "degC") + ": offset or unit?");
      }
      break;
    case Role::kVehicleSpeed:
      if (at(kNearlyMost) > kSpeedMost_m_s) {
        wrong(with_unit(at(kNearlyMost), 3.6, "km/h") + ": no such car goes so fast; unit?");
      }
      break;
    case Role::kAcceleratorPedal:
      if (course_.largest > 1.0 + kPedalBeyond || course_.least < -kPedalBeyond) {
        wrong("from " + text(course_.least) + " to " + text(course_.largest) +
              ": a pedal has 0 to 100 %; unit or scale?");
      } else if (course_.largest > 0.0 && course_.largest <= kPedalAsShare) {
        doubt("never above " + text(course_.largest) + ": a share of 1 read as percent?");
      }
      break;
    default:
      break;
  }
  const double step = course_.step;
  const bool pulley =
      binding_.role == Role::kPrimarySpeed || binding_.role == Role::kSecondarySpeed;
  if (pulley && step > kSpeedStepMost_rad_s) {
    doubt("moves in steps of " + number(in_unit_.difference(step)) + " " + binding_.unit +
          ": too coarse to see slip");
  }
  if (binding_.role == Role::kSecondaryPressure && step > kPressureStepMost_Pa) {
    note("moves in steps of " + number(in_unit_.difference(step)) + " " + binding_.unit + ": " +
         grouped(step * config_.variator.secondary_piston_area_m2) + " N of clamping force");
  }
}

// Values that stand still.
void Judge::course() {
  const bool flag = daemon::role_dimension(binding_.role) == can::Dimension::kNone;
  const bool shaft = binding_.role == Role::kPrimarySpeed ||
                     binding_.role == Role::kSecondarySpeed || binding_.role == Role::kEngineSpeed;
  const double lasted_s = course_.span_s;
  // Oil stays warm, and cruise control needs no pedal.
  if (course_.changes == 0 && lasted_s >= kConstantFor_s) {
    const std::string stands =
        flag ? format("always %.0f", course_.value) : "always " + text(course_.value);
    if (shaft && course_.value != 0.0) {
      wrong(stands + format(", for %.0f s: a shaft that turns is never so even", lasted_s));
    } else if (flag || binding_.role == Role::kOilTemperature ||
               binding_.role == Role::kAcceleratorPedal) {
      note(stands + format(" in these %.0f s", lasted_s));
    } else {
      doubt(stands + format(" in these %.0f s: the right signal?", lasted_s));
    }
    return;
  }
  const double usual_move = std::max(quantile(course_.moves.values(), kUsualMoves), course_.step);
  if (course_.frozen_s >= kStuck_s) {
    const std::string what = format(
        "stood at %s for %.2f s from %.1f s on while the other pulley's speed moved by %.0f %%",
        text(course_.frozen_at).c_str(), course_.frozen_s, course_.frozen_from_s,
        100.0 * course_.frozen_other);
    // With another sign of the torque, or the speeds the other way round, the belt slips there.
    course_.frozen_against && !repeats_itself()
        ? doubt(what +
                ": frozen, or it slips, and sign of the torque or the two speeds are swapped")
        : wrong(what);
  } else if (shaft && repeats_itself()) {
    wrong(
        format("repeats %s for %.2f s from %.1f s on, while else its noise moves it: a frozen "
               "sender or sensor",
               text(course_.stood_at).c_str(), course_.stood_s, course_.stood_from_s));
  } else if (shaft && course_.leap > kLeap * usual_move) {
    wrong(
        format("stood at %s for %.2f s from %.1f s on, then moved by %s in one frame, where %s is "
               "much: a frozen sender or sensor",
               text(course_.leap_at).c_str(), course_.leap_stood_s, course_.leap_from_s,
               number(in_unit_.difference(course_.leap)).c_str(),
               number(in_unit_.difference(usual_move)).c_str()));
  }
}

// A live value that is noisier than its step does not come again and again.
bool Judge::repeats_itself() const {
  const bool usual = course_.live_bends.count() >= course_.stood_values;
  return course_.stood_s >= kStuck_s && course_.stood_values >= kRepeats && course_.step > 0.0 &&
         course_.live_noise() > (usual ? kNoisySteps : kNoisyStepsSeldom) * course_.step;
}

}  // namespace

std::string InUnit::text(double si) const {
  return number(value(si)) + (binding_.unit.empty() ? "" : " " + binding_.unit);
}

std::string id_text(can::CanId id) {
  return id.extended ? format("0x%08Xx", id.value) : format("0x%03X", id.value);
}

bool is_required(Role role, const daemon::Config& config) {
  switch (role) {
    case Role::kPrimarySpeed:
    case Role::kSecondarySpeed:
    case Role::kSecondaryPressure:
      return true;
    case Role::kEngineTorque:
      return config.estimator.torque_is_engine;
    case Role::kPrimaryTorque:
      return !config.estimator.torque_is_engine;
    case Role::kExperimentActive:
      return config.trigger == daemon::Trigger::kSignal;
    default:
      return false;
  }
}

Findings judge_role(const RoleCourse& course, const RoleWatch& watch, const daemon::Config& config,
                    const DbcUnits& units) {
  return Judge(course, watch, config, units).run();
}

}  // namespace beltgrip::check
