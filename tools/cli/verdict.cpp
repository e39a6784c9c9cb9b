#include "tools/cli/verdict.h"

#include <cmath>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "can_dbc/text/format.h"
#include "can_dbc/text/printable.h"
#include "daemon/io/json_text.h"
#include "tools/cli/failure.h"
#include "tools/cli/replay_run.h"
#include "tools/text/json_writer.h"
#include "tools/text/seconds.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

void line(std::FILE* out, const char* what, const std::string& measured, const std::string& truth) {
  std::fprintf(out, "  %-12s %-22s %s\n", what, can::printable(measured).c_str(),
               can::printable(truth).c_str());
}

}  // namespace

Truth make_truth(const sim::RigScenario& scenario, std::uint64_t seed, std::int64_t first_frame_ns,
                 const sim::RigSimulation& simulation) {
  return {scenario.name,     scenario.belt, seed, first_frame_ns, scenario.friction().mu_max,
          simulation.truth()};
}

std::string truth_json(const Truth& truth) {
  text::JsonWriter json;
  json.begin_object()
      .field("type", "truth")
      .field("scenario", truth.scenario)
      .field("belt", truth.belt)
      .field("seed", truth.seed)
      .key("first_frame_s")
      .raw(text::seconds_text(truth.first_frame_ns))
      .field("mu_max", truth.mu_max)
      .key("experiments")
      .begin_array();
  for (const sim::ExperimentTruth& experiment : truth.experiments) {
    const bool peak = experiment.peak_s.has_value();
    json.begin_object()
        .field("mu_max", experiment.mu_max)
        .field("start_s", experiment.start_s)
        .field("peak_s", experiment.peak_s.value_or(text::kJsonNull))
        .field("slip_peak_percent", peak ? experiment.slip_peak_percent : text::kJsonNull)
        .field("sigma_peak_percent", peak ? experiment.sigma_star_peak_percent : text::kJsonNull)
        .field("clamp_force_peak_N", peak ? experiment.clamp_force_peak_N : text::kJsonNull)
        .field("let_go_s", experiment.let_go_s.value_or(text::kJsonNull))
        .field("sigma_max_percent", experiment.sigma_star_max_percent)
        .end_object();
  }
  json.end_array().end_object();
  return json.take() + "\n";
}

Truth read_truth(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Failure{kNoInput, path + ": cannot be read"};
  Truth truth;
  try {
    const auto json =
        daemon::json_of({std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()});
    const auto number = [](const nlohmann::ordered_json& value) {
      return value.is_null() ? std::optional<double>() : value.get<double>();
    };
    truth.scenario = json.at("scenario").get<std::string>();
    truth.belt = json.at("belt").get<std::string>();
    truth.seed = json.at("seed").get<std::uint64_t>();
    truth.first_frame_ns = std::llround(json.at("first_frame_s").get<double>() * 1e9);
    truth.mu_max = json.at("mu_max").get<double>();
    for (const auto& entry : json.at("experiments")) {
      sim::ExperimentTruth experiment;
      experiment.mu_max = entry.at("mu_max").get<double>();
      experiment.start_s = entry.at("start_s").get<double>();
      experiment.peak_s = number(entry.at("peak_s"));
      experiment.sigma_star_peak_percent = number(entry.at("sigma_peak_percent")).value_or(0.0);
      experiment.let_go_s = number(entry.at("let_go_s"));
      experiment.sigma_star_max_percent = entry.at("sigma_max_percent").get<double>();
      truth.experiments.push_back(experiment);
    }
  } catch (const nlohmann::json::exception& error) {
    throw Failure{kBadInput, path + ": not the truth.json of a simulation: " + error.what()};
  }
  return truth;
}

void Verdict::on_frame(std::int64_t t_ns, const monitor::OwnFrameView& view) {
  if (!view.good()) return;
  if (view.message->name == "BeltGripSlip") {
    const bool stop = view.value("MacroSlipStop") > 0.5;
    if (stop && !stop_flag_ && !stop_s_) {
      stop_s_ = static_cast<double>(t_ns) * 1e-9;
      if (view.label("SigmaStar") != "NotAvailable") stop_slip_percent_ = view.value("SigmaStar");
    }
    stop_flag_ = stop;
  } else if (view.message->name == "BeltGripEstimate") {
    kind_ = view.label("MuMaxKind");
    if (kind_ == "None" || mu_max_) return;
    mu_max_ = view.value("MuMax");
    mu_max_std_ = view.value("MuMaxStd");
  }
}

void Verdict::print(std::FILE* out, const Truth& truth) const {
  const sim::ExperimentTruth* experiment =
      truth.experiments.empty() ? nullptr : &truth.experiments.front();
  std::fprintf(out, "\n  %-12s %-22s %s\n", "", "BeltGrip", "truth");
  std::string measured = "no result";
  std::string true_text = format("%.4f", truth.mu_max);
  if (mu_max_ && kind_ == "Value") {
    measured = format("%.4f, std %.4f", *mu_max_, mu_max_std_);
    true_text += format(" (error %+.1f %%)", 100.0 * (*mu_max_ / truth.mu_max - 1.0));
  } else if (mu_max_) {
    measured = format("at least %.4f", *mu_max_);
  }
  line(out, "mu_max", measured, true_text);
  const bool has_peak = experiment != nullptr && experiment->peak_s;
  true_text = has_peak ? format("peak at %.2f s", *experiment->peak_s) : "no peak";
  if (stop_s_ && has_peak) true_text += format(" (%+.2f s)", *stop_s_ - *experiment->peak_s);
  line(out, "stop flag", stop_s_ ? format("at %.2f s", *stop_s_) : "never", true_text);
  if (experiment == nullptr) return;
  true_text = has_peak ? format("%.2f %% at the peak", experiment->sigma_star_peak_percent) : "";
  if (experiment->let_go_s) {
    true_text += format(", %.1f %% when the operator let go at %.2f s",
                        experiment->sigma_star_max_percent, *experiment->let_go_s);
  }
  line(out, "slip at stop", stop_slip_percent_ ? format("%.2f %%", *stop_slip_percent_) : "-",
       true_text);
}

}  // namespace beltgrip::cli
