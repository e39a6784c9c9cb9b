#include "tools/monitor/layout.h"

#include <algorithm>
#include <ctime>
#include <string_view>

#include "can_dbc/text/format.h"
#include "can_dbc/text/printable.h"
#include "estimator/physics/units.h"
#include "tools/monitor/plot.h"

namespace beltgrip::monitor {

namespace {

constexpr int kLabel = 9;          // columns of the words at the left
constexpr int kInputColumns = 31;  // of the table of inputs
constexpr int kRoleColumns = 18, kRoleColumnsWide = 26;
constexpr int kWide = 100;           // columns from which names stand in full
constexpr int kLeastPlot = 30;       // columns that stay for the curve beside it
constexpr int kLeastMiddle = 6;      // rows
constexpr std::size_t kWhyRows = 2;  // for inhibits and for faults together on a small terminal
constexpr int kTall = 40;            // rows from which there is room for more
constexpr std::size_t kWhyRowsTall = 6;
constexpr int kExperimentRows = 3, kExperimentRowsTall = 12;

std::string padded(std::string text, int columns) {
  text.resize(std::max(text.size(), static_cast<std::size_t>(columns)), ' ');
  return text;
}

// What is no ASCII, a name of others', becomes '?'; so a character is a column.
std::string ascii(std::string_view text) {
  std::string out;
  for (const char c : can::printable(text)) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x80) {
      out += c;
    } else if (byte >= 0xC0) {
      out += '?';
    }
  }
  return out;
}

Line labelled(const char* label, std::string text, Tone tone = Tone::kPlain) {
  return {{padded(label, kLabel), Tone::kDim}, {std::move(text), tone}};
}

void cut(Line& line, int columns) {
  auto left = static_cast<std::size_t>(columns);
  for (Piece& piece : line) {
    if (piece.text.size() > left) piece.text.resize(left);
    left -= piece.text.size();
  }
}

std::size_t length(const Line& line) {
  std::size_t sum = 0;
  for (const Piece& piece : line) sum += piece.text.size();
  return sum;
}

Line between(Line left, const std::string& right, int columns) {
  const auto used = static_cast<int>(length(left) + right.size());
  if (used + 1 > columns) return left;
  left.push_back({std::string(static_cast<std::size_t>(columns - used), ' ')});
  left.push_back({right});
  return left;
}

std::string mode_text(const View& view) {
  if (!view.playing) return "live";
  const Playing& play = *view.playing;
  std::string text = play.paused ? "paused" : format("%gx", play.speed);
  if (play.duration_over) text = "end of --duration";
  if (play.ended) text = "end of the log";
  return text + format(", at %.1f s", play.position_s) +
         (view.computed_here ? ", replayed here" : "");
}

Line header(const View& view, int columns) {
  return between({{"beltgrip monitor  ", Tone::kDim},
                  {ascii(view.source), Tone::kStrong},
                  {"  " + mode_text(view)}},
                 wall_text(view.wall_ns), columns);
}

Line bus_line(const View& view) {
  const Traffic& traffic = view.traffic;
  std::string text = view.playing && !view.playing->paused ? "" : link_text(view.link) + ", ";
  text += format("%.0f frames/s, %.0f kbit/s", traffic.frames_per_s, traffic.bit_per_s * 1e-3);
  if (traffic.bitrate) {
    text += format(" (%.0f %% of %g)", 100.0 * traffic.bit_per_s / *traffic.bitrate,
                   *traffic.bitrate * 1e-3);
  }
  if (traffic.lost > 0) {
    text += format(", %llu lost here", static_cast<unsigned long long>(traffic.lost));
  }
  if (traffic.error_frames > 0) {
    text += format(", %llu error frames", static_cast<unsigned long long>(traffic.error_frames));
  }
  const bool works = view.link <= daemon::BusState::kWarning;
  return labelled("bus", text, works ? Tone::kPlain : Tone::kAlarm);
}

std::string distrust_text(const Distrust& distrust) {
  std::string text;
  const auto add = [&](std::uint64_t count, const char* what) {
    if (count == 0) return;
    text += (text.empty() ? "" : ", ") +
            format("%llu %s", static_cast<unsigned long long>(count), what);
  };
  add(distrust.wrong_crc, "wrong CRC");
  add(distrust.wrong_sequence, "wrong counter");
  add(distrust.foreign_version, "of another version");
  return text.empty() ? text : text + "; last " + distrust.last;
}

bool has_interface(const View& view) { return view.link < daemon::BusState::kDown; }

// Who speaks, or that nobody does; and what cannot be believed.
Line daemon_line(const View& view) {
  const std::string distrust = distrust_text(view.distrust);
  if (is_silent(view) || !has_interface(view)) {
    const double seconds = view.silence_s.value_or(view.listening_s);
    std::string text = format("no frames for %.0f s", seconds);
    if (has_interface(view)) text += ": is beltgripd running?";
    if (view.playing) text = format("no frames of BeltGrip for %.0f s", seconds);
    return labelled("daemon", text + (distrust.empty() ? "" : "; " + distrust), Tone::kAlarm);
  }
  if (!distrust.empty()) return labelled("daemon", distrust, Tone::kWarning);
  return labelled("daemon", view.silence_s ? "frames come, all in order" : "no frame yet");
}

Line state_line(const View& view) {
  Line line = labelled("state", view.state, Tone::kStrong);
  line.push_back({", phase " + view.phase});
  if (view.stop) line.push_back({"  STOP: let the clamping force come back", Tone::kAlarm});
  if (view.outcome != "-" && view.outcome != "none" && !view.in_experiment) {
    line.push_back({"; last: " + view.outcome + " (" + view.reason + ")"});
  }
  return line;
}

std::string shortened(std::string text, std::size_t room) {
  constexpr std::string_view kMore = "...";
  text.resize(room);
  if (room > kMore.size()) text.replace(room - kMore.size(), kMore.size(), kMore);
  return text;
}

// Reasons one after the other, as many rows as there are.
void add_reasons(const char* label, const std::vector<Reason>& reasons, const std::string& none,
                 Tone tone, int columns, std::size_t rows_most, std::vector<Line>& lines) {
  if (reasons.empty()) {
    lines.push_back(labelled(label, none));
    return;
  }
  const std::size_t shown = std::min(reasons.size(), rows_most);
  std::size_t spare = rows_most - shown;  // rows for what a long one says beyond its first
  for (std::size_t i = 0; i < shown; ++i) {
    std::string text = reason_text(reasons[i]);
    const std::size_t more = i + 1 == rows_most ? reasons.size() - rows_most : 0;
    const std::string tail = more > 0 ? format(" +%zu", more) : "";
    const std::size_t room =
        static_cast<std::size_t>(std::max(1, columns - kLabel - static_cast<int>(tail.size())));
    const char* name = i == 0 ? label : "";
    while (text.size() > room && spare > 0) {
      const std::size_t space = text.rfind(' ', room);
      const std::size_t end = space == std::string::npos || space == 0 ? room : space;
      lines.push_back(labelled(name, text.substr(0, end), tone));
      text.erase(0, end + (end == space ? 1 : 0));
      name = "";
      --spare;
    }
    if (text.size() > room) text = shortened(std::move(text), room);
    lines.push_back(labelled(name, text + tail, tone));
  }
}

std::string force_text(const std::optional<double>& force_N) {
  return force_N ? format("%.0f N", *force_N) : "-";
}

// What the belt has carried without slip: a line for all directions and end stops that are known.
void add_carried(const daemon::CarriedBounds& bounds, int columns, std::vector<Line>& lines) {
  std::string text;
  for (std::size_t group = 0; group < bounds.size(); ++group) {
    const daemon::CarriedBound& bound = bounds[group];
    if (!bound.known()) continue;
    text += (text.empty() ? "without slip, " : "; ") + daemon::group_text(group) +
            format(": mu_max at least %.4f", bound.mu_max_least);
    if (const auto share = daemon::reserve_share(bound)) {
      text += format(", reserve %.0f %%", estimator::kPercent * *share);
    }
  }
  if (text.empty()) return;
  lines.push_back(labelled("carried", text));
  cut(lines.back(), columns);
}

Line now_line(const View& view) {
  std::string text = "mu* ";
  text += view.mu_star ? format("%.4f", *view.mu_star) : "-";
  text += view.sigma_star_percent ? format(" at %.2f %% slip", *view.sigma_star_percent) : "";
  text += view.friction_slope ? format(", slope %.4f 1/%%", *view.friction_slope) : "";
  return labelled("now", text);
}

Line clamp_line(const View& view) {
  std::string text = "asked " + force_text(view.force_asked_N);
  if (view.inhibits_known) text += ", given " + force_text(view.force_given_N);
  return labelled("clamp", text + ", least that holds the belt " + force_text(view.force_least_N));
}

// What is too long for its column stays apart from what begins alike.
std::string short_role(const std::string& role, int columns) {
  constexpr std::string_view kLong = "secondary";
  const bool is_long = role.size() > static_cast<std::size_t>(columns) && role.starts_with(kLong);
  return is_long ? "sec." + role.substr(kLong.size()) : role;
}

std::vector<Line> input_table(const View& view, int role_columns, int rows) {
  std::vector<Line> lines;
  if (rows < 2 || view.inputs.empty()) return lines;
  lines.push_back(
      {{format("%-*s %10s %5s %4s trust", role_columns, "input", "value", "age s", "1/s"),
        Tone::kDim}});
  for (const InputRow& row : view.inputs) {
    if (static_cast<int>(lines.size()) == rows) break;
    std::string value = "-";
    if (row.value && row.is_flag) value = *row.value > 0.5 ? "yes" : "no";
    if (row.value && !row.is_flag) value = format("%.4g %s", *row.value, row.unit.c_str());
    const std::string age = row.value ? format("%.2f", std::min(row.age_s, 99.99)) : "-";
    const std::string trust =
        row.good ? row.trust : row.trust + format(" %.1f s", std::min(row.trust_s, 999.9));
    lines.push_back({{format("%-*.*s %10.10s %5s %4.0f ", role_columns, role_columns,
                             short_role(row.role, role_columns).c_str(), value.c_str(), age.c_str(),
                             row.rate_Hz)},
                     {trust, row.good ? Tone::kGood : Tone::kAlarm}});
  }
  const std::size_t hidden = view.inputs.size() + 1 - lines.size();
  if (hidden > 0) lines.back() = {{format("... and %zu more", hidden + 1), Tone::kDim}};
  return lines;
}

// The curve, and beside it the inputs where there is room for both.
std::vector<Line> middle(const View& view, int columns, int rows) {
  const int role_columns = columns >= kWide ? kRoleColumnsWide : kRoleColumns;
  const int input_columns = role_columns + kInputColumns;
  const bool beside = !view.inputs.empty() && columns >= input_columns + kLeastPlot;
  const int plot_columns = beside ? columns - input_columns - 1 : columns;
  const std::vector<std::string> curve = plot(view.curve, view.friction, plot_columns, rows);
  std::vector<Line> inputs;
  if (beside) inputs = input_table(view, role_columns, rows);
  std::vector<Line> lines;
  for (std::size_t i = 0; i < curve.size(); ++i) {
    Line line{{padded(curve[i], beside ? plot_columns + 1 : 0)}};
    if (i < inputs.size()) line.insert(line.end(), inputs[i].begin(), inputs[i].end());
    lines.push_back(std::move(line));
  }
  if (view.curve.empty() && view.friction.kind == estimator::PeakKind::kNone && rows > 1) {
    lines[0].insert(lines[0].begin(), {"no curve yet", Tone::kDim});
    if (lines[0].size() > 1) {
      std::string& blank = lines[0][1].text;
      blank.erase(0, std::min<std::size_t>(blank.size(), 12));
    }
  }
  return lines;
}

std::vector<Line> experiment_table(const View& view, int rows) {
  std::vector<Line> lines;
  if (rows < 2) return lines;
  lines.push_back(
      {{format("%-8s %-12s %-18s %-29s slip to", "at", "outcome", "stop", "mu_max"), Tone::kDim}});
  for (auto each = view.experiments.rbegin();
       each != view.experiments.rend() && static_cast<int>(lines.size()) < rows; ++each) {
    const std::string wall = wall_text(each->t_ns - view.t_ns + view.wall_ns);
    lines.push_back({{format("%-8s %-12s %-18s %-29s %.1f %%", wall.substr(11).c_str(),
                             each->outcome.c_str(), each->reason.c_str(),
                             friction_text(each->friction).c_str(), each->sigma_most_percent)}});
  }
  if (view.experiments.empty()) lines.push_back({{"none since this monitor began", Tone::kDim}});
  return lines;
}

Line keys(const View& view) {
  if (!view.playing) return {{"space hold  q quit", Tone::kDim}};
  return {{"space pause  s step  left/right 10 s  PgUp/PgDn 60 s  +/- speed  q quit", Tone::kDim}};
}

}  // namespace

std::string wall_text(std::int64_t wall_ns) {
  const std::time_t seconds = wall_ns / 1'000'000'000;
  std::tm local{};
  localtime_r(&seconds, &local);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%d %H:%M:%S", &local);
  return text;
}

std::string friction_text(const Friction& friction) {
  switch (friction.kind) {
    case estimator::PeakKind::kNone:
      return "-";
    case estimator::PeakKind::kValue:
      return format("%.4f, 95 %% %.4f to %.4f", friction.mu_max, friction.low(), friction.high());
    case estimator::PeakKind::kLowerBound:
      return format("at least %.4f", friction.mu_max);
  }
  return "-";
}

namespace {

// What was said of an instant is not shown as if it were now.
View without_what_was(View view) {
  if (view.silence_s) view.state += format(" %.0f s ago", *view.silence_s);
  view.stop = false;
  view.faults.clear();
  view.mu_star.reset();
  view.sigma_star_percent.reset();
  view.friction_slope.reset();
  view.force_asked_N.reset();
  return view;
}

std::vector<Line> layout_of(const View& view, Size size) {
  const int columns = std::max(1, size.columns);
  const std::size_t why_rows = size.rows >= kTall ? kWhyRowsTall : kWhyRows;
  std::vector<Line> lines;
  lines.push_back(header(view, columns));
  lines.push_back(bus_line(view));
  lines.push_back(daemon_line(view));
  lines.push_back(state_line(view));
  if (!view.in_experiment) {
    // The inputs are looked at here, the faults are what the daemon says.
    const std::string none = !view.inhibits_known  ? "inputs and inhibits: with --config FILE"
                             : view.faults.empty() ? "nothing keeps an experiment from beginning"
                                                   : "by the inputs nothing; the faults may";
    add_reasons("why", view.inhibits, none, Tone::kPlain, columns, why_rows, lines);
  }
  add_reasons("faults", view.faults, "none", Tone::kAlarm, columns, why_rows, lines);
  lines.push_back(now_line(view));
  lines.push_back(clamp_line(view));
  lines.push_back(labelled(
      "mu_max",
      friction_text(view.friction) + format("; results since its start: %u", view.experiment_count),
      Tone::kStrong));
  add_carried(view.carried, columns, lines);
  const int left = size.rows - static_cast<int>(lines.size()) - 1;  // the keys
  const int shown = static_cast<int>(view.experiments.size()) + 1;
  const int wanted =
      std::clamp(shown, 2, size.rows >= kTall ? kExperimentRowsTall : kExperimentRows);
  const int below = left - wanted >= kLeastMiddle ? wanted : 0;
  if (left - below > 0) {
    for (Line& line : middle(view, columns, left - below)) lines.push_back(std::move(line));
  }
  for (Line& line : experiment_table(view, below)) lines.push_back(std::move(line));
  lines.push_back(keys(view));
  for (Line& line : lines) cut(line, columns);
  if (static_cast<int>(lines.size()) > size.rows) {
    lines.resize(static_cast<std::size_t>(std::max(0, size.rows)));
  }
  return lines;
}

}  // namespace

std::vector<Line> layout(const View& view, Size size) {
  return layout_of(is_silent(view) ? without_what_was(view) : view, size);
}

std::string text_of(const std::vector<Line>& lines) {
  std::string out;
  for (const Line& line : lines) {
    std::string text;
    for (const Piece& piece : line) text += piece.text;
    text.erase(text.find_last_not_of(' ') + 1);
    out += text + "\n";
  }
  return out;
}

}  // namespace beltgrip::monitor
