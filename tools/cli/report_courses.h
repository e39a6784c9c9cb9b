// What a report shows of a replay: the drive and its experiments, sample by sample. Tools only.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/base/faults.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/loop/loop.h"
#include "tools/cli/progress.h"
#include "tools/cli/replay_run.h"
#include "tools/report/drive_page.h"
#include "tools/report/experiment_page.h"

namespace beltgrip::cli {

// The belt's last value, and where.
struct LastValue {
  std::string name;  // of its experiment
  double mu_max = 0.0, sigma_peak_percent = 0.0;
  estimator::EndStop end_stop = estimator::EndStop::kOverdrive;
};

class ReportCourses final : public daemon::SampleSink {
 public:
  ReportCourses(std::string log, const daemon::Config& config, RunProgress& progress);

  void on_report(const daemon::SampleReport& report) noexcept override;
  // Once the replay is over.
  void finish(const ReplayResult& result);
  report::Drive take_drive() { return std::move(drive_); }
  std::vector<report::ExperimentCourse> take_experiments() { return std::move(experiments_); }
  const std::optional<LastValue>& last_value() const { return last_value_; }

 private:
  static constexpr std::size_t kLaneCount = 1 + daemon::kInhibitCount + daemon::kFaultCount;

  void take_wear(const daemon::SampleReport& report);
  void take_drive_sample(const daemon::SampleReport& report, double t_s);
  void take_lanes(const daemon::SampleReport& report, double t_s);
  void take_requests(const std::vector<daemon::RecordedRequest>& followed);
  void take_result(const daemon::ExperimentResult& result);

  std::string log_;
  const daemon::Config& config_;
  RunProgress& progress_;
  double period_s_;
  report::Drive drive_;
  report::ExperimentCourse now_;
  std::vector<report::ExperimentCourse> experiments_;
  std::optional<LastValue> last_value_;
  estimator::EndStop end_stop_ = estimator::EndStop::kOverdrive;
  report::Wear of_this_;         // experiment
  bool slip_known_ = false;      // at this sample
  double curve_energy_J_ = 0.0;  // as the curve had it at the sample before
  std::array<std::optional<double>, kLaneCount> since_s_{};
  std::array<std::vector<report::Interval>, kLaneCount> spans_s_{};
};

}  // namespace beltgrip::cli
