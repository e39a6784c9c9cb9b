#include "tools/cli/signals_out.h"

#include <array>
#include <limits>

#include "can_dbc/text/unit_text.h"

namespace beltgrip::cli {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// What the pipeline gives beside the inputs. `curve`: only in an experiment, where it is defined.
struct Column {
  const char* name;
  const char* unit;
  bool curve;
  double (*value)(const daemon::SampleReport& report);
};

double expected(const daemon::SampleReport& report, double value) {
  return report.curve.mu_max_expected > 0.0 ? value : kNone;
}

using Report = daemon::SampleReport;
constexpr std::array kColumns{
    Column{"state", "", false, [](const Report& r) { return static_cast<double>(r.state); }},
    Column{"in_experiment", "", false, [](const Report& r) { return r.in_experiment ? 1.0 : 0.0; }},
    Column{"inhibits", "", false, [](const Report& r) { return static_cast<double>(r.inhibits); }},
    Column{"faults", "", false, [](const Report& r) { return static_cast<double>(r.faults); }},
    Column{"clamp_force_asked", "N", false,
           [](const Report& r) { return r.request_force_N > 0.0 ? r.request_force_N : kNone; }},
    Column{"macro_slip_stop", "", false,
           [](const Report& r) { return r.macro_slip_stop ? 1.0 : 0.0; }},
    Column{"mu_star", "", true, [](const Report& r) { return r.curve.mu_star; }},
    Column{"sigma_star", "%", true, [](const Report& r) { return r.curve.sigma_star_percent; }},
    Column{"slip_variance", "%^2", true, [](const Report& r) { return r.curve.slip_variance; }},
    Column{"friction_slope", "1/%", true, [](const Report& r) { return r.curve.friction_slope; }},
    Column{"phase", "", true, [](const Report& r) { return static_cast<double>(r.curve.phase); }},
    Column{"clamp_force", "N", true, [](const Report& r) { return r.curve.clamp_force_N; }},
    Column{"belt_torque", "Nm", true, [](const Report& r) { return r.curve.torque_p_Nm; }},
    Column{"mu_max_expected", "", true,
           [](const Report& r) { return expected(r, r.curve.mu_max_expected); }},
    Column{"mu_max_low", "", true, [](const Report& r) { return expected(r, r.curve.mu_max_low); }},
    Column{"mu_max_high", "", true,
           [](const Report& r) { return expected(r, r.curve.mu_max_high); }}};

}  // namespace

std::vector<signals::Signal> signal_columns(const daemon::Config& config) {
  std::vector<signals::Signal> columns;
  columns.reserve(config.roles.size() + kColumns.size());
  for (const daemon::RoleBinding& binding : config.roles) {
    columns.push_back({std::string(daemon::role_name(binding.role)),
                       std::string(can::si_unit_text(daemon::role_dimension(binding.role)))});
  }
  for (const Column& column : kColumns) columns.push_back({column.name, column.unit});
  return columns;
}

void signal_values(const daemon::SampleReport& report, const daemon::Pipeline& pipeline,
                   const daemon::Config& config, std::vector<double>& values) {
  values.clear();
  values.reserve(config.roles.size() + kColumns.size());
  for (const daemon::RoleBinding& binding : config.roles) {
    const daemon::SignalObservation seen = pipeline.signal(binding.role);
    const bool live = seen.seen && seen.status.verdict <= estimator::ReadingVerdict::kFrozen;
    values.push_back(live ? seen.value : kNone);
  }
  const bool has_curve = report.in_experiment && report.curve.usable;
  for (const Column& column : kColumns) {
    values.push_back(column.curve && !has_curve ? kNone : column.value(report));
  }
}

}  // namespace beltgrip::cli
