// Distributions of test statistics, over Eigen's special functions. Pure functions, any thread.
#pragma once

namespace beltgrip::estimator {

// Probability that t with these degrees of freedom (> 0) is at most x.
double student_cdf(double x, double degrees);
// Probability of a magnitude of at least t.
double student_p(double t, double degrees);
// The x of a probability in (0, 1).
double student_quantile(double probability, double degrees);
// Probability of at least f with these degrees of freedom (> 0); of at least chi2.
double f_p(double f, double numerator_degrees, double denominator_degrees);
double chi2_p(double chi2, int degrees);
// -log10 of that, also where it is too small for a number. Never negative.
double chi2_decades(double chi2, int degrees);

}  // namespace beltgrip::estimator
