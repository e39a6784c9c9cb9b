// No function takes or gives lanes once all is inline: there is no calling convention to change.
#pragma GCC diagnostic ignored "-Wpsabi"
#include "tools/diagnose/infer/column_work.h"

#include <cstring>

#include "tools/diagnose/model/lanes.h"

namespace beltgrip::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Value = LanesOf<4>::Value;  // of two registers where four numbers have none
constexpr Index kLanes = 4;

BELTGRIP_LANES Value load(const double* from) {
  Value out;
  std::memcpy(&out, from, sizeof out);
  return out;
}

struct Side {
  const double* first;
  Index stride, columns;
  const double* column(Index i) const { return first + i * stride; }
};

// Sums of kA columns of a with kB of b, all kept in registers.
template <Index kA, Index kB>
BELTGRIP_LANES void add_up(const Side& a, Index i, const Side& b, Index j, Index rows,
                           MatrixXd& out) {
  Value sum[kA][kB] = {};
  const double* const of_a = a.column(i);
  const double* const of_b = b.column(j);
  const Index whole = rows - rows % kLanes;
  for (Index row = 0; row < whole; row += kLanes) {
    Value right[kB];
    for (Index q = 0; q < kB; ++q) right[q] = load(of_b + q * b.stride + row);
    for (Index p = 0; p < kA; ++p) {
      const Value left = load(of_a + p * a.stride + row);
      for (Index q = 0; q < kB; ++q) sum[p][q] += left * right[q];
    }
  }
  for (Index p = 0; p < kA; ++p) {
    for (Index q = 0; q < kB; ++q) {
      const Value& each = sum[p][q];
      double all = (each[0] + each[2]) + (each[1] + each[3]);
      for (Index row = whole; row < rows; ++row) {
        all += of_a[p * a.stride + row] * of_b[q * b.stride + row];
      }
      out.data()[(j + q) * out.rows() + i + p] = all;
    }
  }
}

// below: only where the column of a is not before that of b.
template <Index kA, Index kB>
BELTGRIP_LANES void add_all(const Side& a, const Side& b, Index rows, bool below, MatrixXd& out) {
  Index j = 0;
  for (; j + kB <= b.columns; j += kB) {
    Index i = below ? j : 0;
    for (; i + kA <= a.columns; i += kA) add_up<kA, kB>(a, i, b, j, rows, out);
    for (; i < a.columns; ++i) add_up<1, kB>(a, i, b, j, rows, out);
  }
  for (; j < b.columns; ++j) {
    for (Index i = below ? j : 0; i < a.columns; ++i) add_up<1, 1>(a, i, b, j, rows, out);
  }
}

// As many sums as the registers hold, sixteen of them: 12 of one register each, or 4 of two.
BELTGRIP_FOUR void add_by_four(const Side& a, const Side& b, Index rows, bool below,
                               MatrixXd& out) {
  add_all<4, 3>(a, b, rows, below, out);
}
void add_by_two(const Side& a, const Side& b, Index rows, bool below, MatrixXd& out) {
  add_all<2, 2>(a, b, rows, below, out);
}

void add(const Side& a, const Side& b, Index rows, bool below, MatrixXd& out) {
  static const bool kHasFour = has_four();
  (kHasFour ? add_by_four : add_by_two)(a, b, rows, below, out);
}

Side side_of(const Columns& columns) {
  return {columns.data(), columns.outerStride(), columns.cols()};
}

BELTGRIP_LANES void predict_all(const PredictionFilter& filter, const double* in,
                                const double* weight, Index count, double* out) {
  const double* const a = filter.coefficient;
  const double scale = 1.0 / filter.sigma;
  Index i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    const double* const x = in + i;
    const Value error = load(x) - a[0] * load(x - 1) - a[1] * load(x - 2) - a[2] * load(x - 3) -
                        a[3] * load(x - 4) - a[4] * load(x - 5) - a[5] * load(x - 6);
    const Value scaled = error * scale * load(weight + i);
    std::memcpy(out + i, &scaled, sizeof scaled);
  }
  for (; i < count; ++i) {
    const double* const x = in + i;
    const double error = x[0] - a[0] * x[-1] - a[1] * x[-2] - a[2] * x[-3] - a[3] * x[-4] -
                         a[4] * x[-5] - a[5] * x[-6];
    out[i] = error * scale * weight[i];
  }
}
static_assert(kFilterOrder == 6);

BELTGRIP_FOUR void predict_by_four(const PredictionFilter& filter, const double* in,
                                   const double* weight, Index count, double* out) {
  predict_all(filter, in, weight, count, out);
}
void predict_by_two(const PredictionFilter& filter, const double* in, const double* weight,
                    Index count, double* out) {
  predict_all(filter, in, weight, count, out);
}

}  // namespace

MatrixXd products(const Columns& a, const Columns& b) {
  MatrixXd out(a.cols(), b.cols());
  add(side_of(a), side_of(b), a.rows(), false, out);
  return out;
}

MatrixXd products(const Columns& a) {
  MatrixXd out(a.cols(), a.cols());
  add(side_of(a), side_of(a), a.rows(), true, out);
  out.triangularView<Eigen::StrictlyUpper>() = out.transpose();
  return out;
}

MatrixXd products_in_pairs(const Columns& a, const Columns& b) {
  MatrixXd out(a.cols(), b.cols());
  add_by_two(side_of(a), side_of(b), a.rows(), false, out);
  return out;
}

void predict(const PredictionFilter& filter, const double* in, const double* weight, Index count,
             double* out) {
  static const bool kHasFour = has_four();
  (kHasFour ? predict_by_four : predict_by_two)(filter, in, weight, count, out);
}

}  // namespace beltgrip::diagnose
