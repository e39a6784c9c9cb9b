// What the newest results say of a belt, beside what all of them say together (belt_history.h): the
// last value of each direction and end stop, whether the belt has slipped there with less since,
// and how far friction has fallen elsewhere since. It is one belt: what one group shows counts for
// the others until they are measured themselves. Pure, fixed memory, any thread.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "estimator/method/slip_curve_estimator.h"

namespace beltgrip::estimator {

// Directions and end stops, in one order everywhere.
inline constexpr std::size_t kBeltGroups = 4;
constexpr std::size_t belt_group(Direction direction, EndStop end_stop) noexcept {
  return (direction == Direction::kDrive ? 0U : 2U) + (end_stop == EndStop::kOverdrive ? 0U : 1U);
}
constexpr Direction direction_of(std::size_t group) noexcept {
  return group < 2 ? Direction::kDrive : Direction::kOverrun;
}
constexpr EndStop end_stop_of(std::size_t group) noexcept {
  return group % 2 == 0 ? EndStop::kOverdrive : EndStop::kLow;
}

struct BeltMemory {
  struct Value {
    double mu_max = 0.0;  // 0: none yet
    double ci95_low = 0.0;
    double relative_noise = 0.0;
    double as_read = 0.0;  // mu_max under the configuration's constants; 0: not known any more,
    double carried_Nm_per_N = 0.0;  // but what was carried as its experiment ended
    unsigned order = 0;
    std::array<double, kBeltGroups> others{};  // mu_max of the others as this was measured
    bool known() const noexcept { return mu_max > 0.0; }
  };
  // Slipped with less friction than was known, without giving a value.
  struct Slip {
    double carried_Nm_per_N = 0.0;  // torque by clamp force, the most it carried; 0: none since the
    unsigned order = 0;             // last value
    bool known() const noexcept { return carried_Nm_per_N > 0.0; }
  };
  std::array<Value, kBeltGroups> values{};
  std::array<Slip, kBeltGroups> slips{};
  std::size_t newest = kBeltGroups;  // group of the last value; kBeltGroups: there is none
  unsigned results = 0;

  void take_value(std::size_t group, double mu_max, double ci95_low, double relative_noise,
                  double as_read, double carried_Nm_per_N) noexcept;
  void take_slip(std::size_t group, double carried_Nm_per_N) noexcept;
  bool any_slip() const noexcept;
  // The group whose value a group rests on: its own, or the newest; kBeltGroups: there is none.
  std::size_t rests_on(std::size_t group) const noexcept {
    return values[group].known() ? group : newest;
  }
  // Share of friction that values of other groups have left of a group's own since it was measured;
  // 1 where that is no more than noise. scatter: between experiments, relative.
  double share_left(std::size_t group, double scatter) const noexcept;

  // All of it as plain numbers, for a record, and back.
  static constexpr std::size_t kNumbers = 2 + kBeltGroups * (8 + kBeltGroups);
  std::array<double, kNumbers> numbers() const;
  static BeltMemory of_numbers(std::span<const double, kNumbers> numbers);

 private:
  // Every number, in order.
  template <typename Memory, typename Visitor>
  static void visit(Memory& memory, Visitor&& each) {
    each(memory.newest);
    each(memory.results);
    for (auto& value : memory.values) {
      each(value.mu_max), each(value.ci95_low), each(value.relative_noise), each(value.as_read);
      each(value.carried_Nm_per_N), each(value.order);
      for (auto& other : value.others) each(other);
    }
    for (auto& slip : memory.slips) each(slip.carried_Nm_per_N), each(slip.order);
  }
};

}  // namespace beltgrip::estimator
