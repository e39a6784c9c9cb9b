#include "tools/report/drive_page.h"

#include <utility>

#include "can_dbc/text/number_text.h"

namespace beltgrip::report {
namespace {

std::vector<std::string> wear_row(const char* when, const Wear& wear) {
  std::vector<std::string> row{when};
  for (const double value : {wear.known_s, wear.energy_J, wear.path_m, wear.slip_most_percent}) {
    row.push_back(fixed_text(value, 1));
  }
  return row;
}

}  // namespace

void add_drive(HtmlPage& page, Drive drive) {
  page.heading(drive.name);
  if (drive.t_s.empty()) {
    page.paragraph("No sample of it could be used.");
    return;
  }
  Courses courses;
  courses.t_s = std::move(drive.t_s);
  courses.period_s = drive.period_s;
  courses.marks = std::move(drive.results);
  courses.spans_s = std::move(drive.experiments_s);
  const auto panel = [&](const char* label, std::vector<Course> series) {
    courses.panels.push_back({label, std::move(series), {}, {}, {}});
  };
  courses.panels.push_back({"what stood", {}, {}, {}, std::move(drive.lanes)});
  panel("clamping force, N", {{"given", std::move(drive.clamp_force_N)},
                              {"asked", std::move(drive.asked_force_N), Style::kDashed}});
  panel("traction coefficient",
        {{"mu*", std::move(drive.mu_star)}, {"mu_max", std::move(drive.mu_max), Style::kSteps}});
  panel("slip, %", {{"sigma*", std::move(drive.sigma_star_percent)}});
  panel("slip energy so far, before the peak too, J", {{"energy", std::move(drive.slip_energy_J)}});
  panel("torque, Nm", {{"as measured", std::move(drive.torque_Nm)},
                       {"on the belt", std::move(drive.belt_torque_Nm)}});
  panel("speed, rad/s", {{"primary", std::move(drive.primary_speed_rad_s)},
                         {"secondary", std::move(drive.secondary_speed_rad_s)}});
  page.courses(courses);
  page.table({"what the belt went through", "slip known for, s",
              "slip energy, before the peak too, J", "slip path, m", "slip up to, %"},
             {wear_row("while an experiment ran or could have begun", drive.whole),
              wear_row("while one ran", drive.in_experiments)});
  if (!drive.reasons.empty()) page.table(kReasonHeader, drive.reasons);
}

}  // namespace beltgrip::report
