// The friction curve at several abscissae at once, lane by lane by the same arithmetic as
// CurveShape::evaluate and nominal_inverse: the same bits.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

#include "tools/diagnose/model/lanes.h"
#include "tools/diagnose/model/variator_model.h"

namespace beltgrip::diagnose {

template <typename Lanes>
class CurveLanes {
 public:
  using Value = typename Lanes::Value;
  using Mask = typename Lanes::Mask;
  using Index = typename Lanes::Index;
  static constexpr int kCount = sizeof(Value) / sizeof(double);
  struct Point {
    Value value, slope;
  };

  BELTGRIP_LANES explicit CurveLanes(const CurveShape& curve)
      : curve_(curve), inverse_(NominalInverse::points()) {}

  // A curve with a fall, and a lane beyond the table, are evaluated one by one.
  static bool can(const CurveShape& curve) { return curve.fall_ == 0.0; }
  BELTGRIP_LANES static Mask is_beyond(Value x) {
    return ~(size_of(x) < static_cast<double>(CurveShape::kCellUnits));
  }

  BELTGRIP_LANES Point evaluate(Value x) const {
    constexpr double kEnd = CurveShape::kEnd.back();
    constexpr double kPerUnit = CurveShape::kCellsPerUnit;
    const Value inside = is_beyond(x) ? Value{} : size_of(x);
    const Value at = inside * kPerUnit;
    const Index i = __builtin_convertvector(at, Index);
    const Value v = at - __builtin_convertvector(i, Value);
    const CurveShape::Cell* const cells = curve_.cells_->data();
    const auto nominal = [&](std::size_t term) BELTGRIP_INLINE {
      return gather([&](int lane)
                        BELTGRIP_INLINE { return cells[row(i, lane)].nominal.data()[term]; });
    };
    const Value n1 = nominal(1), n2 = nominal(2), n3 = nominal(3);
    Point out{nominal(0) + v * (n1 + v * (n2 + v * n3)),
              (n1 + v * (2.0 * n2 + 3.0 * v * n3)) * kPerUnit};
    // No two ends lie in one cell.
    const double* const ends = CurveShape::kEnd.data();
    const Rows interval = rows([&](int lane) BELTGRIP_INLINE {
      const std::size_t first = cells[row(i, lane)].interval;
      return first + static_cast<std::size_t>(first + 2 < CurveShape::kEnds &&
                                              ends[first + 1] < inside[lane]);
    });
    const auto* const cubics = curve_.cubic_.data();
    const auto cubic = [&](std::size_t term) BELTGRIP_INLINE {
      return gather([&](int lane)
                        BELTGRIP_INLINE { return cubics[interval.of[lane]].data()[term]; });
    };
    const Value begin = gather([&](int lane) BELTGRIP_INLINE { return ends[interval.of[lane]]; });
    const Value u = (inside < kEnd ? inside : Value{} + kEnd) - begin;
    const Value c1 = cubic(1), c2 = cubic(2), c3 = cubic(3);
    out.value += cubic(0) + u * (c1 + u * (c2 + u * c3));
    const Value bent = out.slope + (c1 + u * (2.0 * c2 + 3.0 * u * c3));
    out.slope = inside < kEnd ? bent : out.slope;
    out.value = std::bit_cast<Value>(std::bit_cast<Mask>(out.value) ^ sign_of(x));
    return out;
  }

  // Lanes where there is none hold no sense: has_inverse.
  BELTGRIP_LANES static Mask has_inverse(Value value) { return size_of(value) < 1.0; }
  BELTGRIP_LANES Value nominal_inverse(Value value) const {
    constexpr double kRoots = NominalInverse::kRoots;
    const Value size = has_inverse(value) ? size_of(value) : Value{};
    const Value at = root(1.0 - size) * kRoots;
    const Index whole = __builtin_convertvector(at, Index);
    const Index most = Index{} + (NominalInverse::kRoots - 1);
    const Index i = whole < most ? whole : most;
    const Value u = at - __builtin_convertvector(i, Value);
    const auto x = [&](std::size_t beside) BELTGRIP_INLINE {
      return gather([&](int lane)
                        BELTGRIP_INLINE { return inverse_.data()[row(i, lane) + beside].x; });
    };
    const auto step = [&](std::size_t beside) BELTGRIP_INLINE {
      return gather([&](int lane)
                        BELTGRIP_INLINE { return inverse_.data()[row(i, lane) + beside].step; });
    };
    const Value a = x(0), a_step = step(0), b_step = step(1);
    const Value rise = x(1) - a;
    const Value out = a + u * (a_step + u * (3.0 * rise - 2.0 * a_step - b_step +
                                             u * (a_step + b_step - 2.0 * rise)));
    return std::bit_cast<Value>(std::bit_cast<Mask>(size_of(out)) | sign_of(value));
  }

  BELTGRIP_LANES static Value root(Value x) {
    return gather([&](int lane) BELTGRIP_INLINE { return __builtin_sqrt(x[lane]); });
  }
  BELTGRIP_LANES static Value size_of(Value x) {
    return std::bit_cast<Value>(std::bit_cast<Mask>(x) & kAllButSign);
  }

 private:
  static constexpr std::int64_t kAllButSign = std::numeric_limits<std::int64_t>::max();
  BELTGRIP_LANES static Mask sign_of(Value x) { return std::bit_cast<Mask>(x) & ~kAllButSign; }
  BELTGRIP_LANES static std::size_t row(Index i, int lane) {
    return static_cast<std::size_t>(static_cast<std::uint32_t>(i[lane]));
  }
  // Without loops, which the compiler would leave as such.
  static constexpr std::make_integer_sequence<int, kCount> kLanes{};
  template <typename Of, int... kLane>
  BELTGRIP_LANES static Value gather(const Of& of, std::integer_sequence<int, kLane...>) {
    return Value{of(kLane)...};
  }
  template <typename Of>
  BELTGRIP_LANES static Value gather(const Of& of) {
    return gather(of, kLanes);
  }
  struct Rows {
    std::size_t of[kCount];
  };
  template <typename Of, int... kLane>
  BELTGRIP_LANES static Rows rows(const Of& of, std::integer_sequence<int, kLane...>) {
    return {{of(kLane)...}};
  }
  template <typename Of>
  BELTGRIP_LANES static Rows rows(const Of& of) {
    return rows(of, kLanes);
  }

  const CurveShape& curve_;
  const NominalInverse::Points& inverse_;
};

}  // namespace beltgrip::diagnose
