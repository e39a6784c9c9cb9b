#pragma once

namespace beltgrip::estimator {

constexpr double square(double x) { return x * x; }

}  // namespace beltgrip::estimator
