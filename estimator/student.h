// Student's t distribution, for tests on few values. Pure functions, any thread.
#pragma once

namespace beltgrip::estimator {

// Probability that t with these degrees of freedom (> 0) is at most x.
double student_cdf(double x, double degrees);
// The x of a probability in (0, 1).
double student_quantile(double probability, double degrees);

}  // namespace beltgrip::estimator
