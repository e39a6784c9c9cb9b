#include "tools/monitor/view_json.h"

#include "tools/text/json_writer.h"
#include "tools/text/seconds.h"

namespace beltgrip::monitor {

namespace {

using text::JsonWriter;

double or_null(const std::optional<double>& value) { return value.value_or(text::kJsonNull); }

void add_reasons(JsonWriter& json, const char* key, const std::vector<Reason>& reasons) {
  json.key(key).begin_array();
  for (const Reason& each : reasons) {
    json.begin_object()
        .field("name", each.name)
        .field("means", each.means)
        .field("figure", each.figure)
        .field("remedy", each.remedy)
        .end_object();
  }
  json.end_array();
}

void add_friction(JsonWriter& json, const Friction& friction) {
  const bool value = friction.kind == estimator::PeakKind::kValue;
  const bool bound = friction.kind == estimator::PeakKind::kLowerBound;
  json.field("mu_max", value ? friction.mu_max : text::kJsonNull)
      .field("mu_max_std", value ? friction.std : text::kJsonNull)
      .field("mu_max_lower_bound", bound ? friction.mu_max : text::kJsonNull);
}

void add_experiments(JsonWriter& json, const View& view) {
  json.key("experiments").begin_array();
  for (const ExperimentRow& each : view.experiments) {
    json.begin_object()
        .key("t_s")
        .raw(text::seconds_text(each.t_ns - view.t_ns + view.wall_ns))
        .field("outcome", each.outcome)
        .field("stop_reason", each.reason);
    add_friction(json, each.friction);
    json.field("sigma_most_percent", each.sigma_most_percent).end_object();
  }
  json.end_array();
}

void add_carried(JsonWriter& json, const View& view) {
  json.key("carried").begin_array();
  for (std::size_t group = 0; group < view.carried.size(); ++group) {
    const daemon::CarriedBound& bound = view.carried[group];
    if (!bound.known()) continue;
    json.begin_object()
        .field("group", daemon::group_text(group))
        .field("mu_max_lower_bound", bound.mu_max_least)
        .field("mu_star", bound.mu_star)
        .field("torque_Nm", bound.torque_Nm)
        .field("clamp_force_N", bound.clamp_force_N)
        .field("reserve_share", or_null(daemon::reserve_share(bound)))
        .end_object();
  }
  json.end_array();
}

void add_inputs(JsonWriter& json, const View& view) {
  json.key("inputs").begin_object();
  for (const InputRow& each : view.inputs) {
    json.key(each.role)
        .begin_object()
        .field("value", or_null(each.value))
        .field("unit", each.unit)
        .field("age_s", each.value ? each.age_s : text::kJsonNull)
        .field("rate_Hz", each.rate_Hz)
        .field("trust", each.trust)
        .field("trust_s", each.trust_s)
        .end_object();
  }
  json.end_object();
}

}  // namespace

std::string view_json(const View& view) {
  JsonWriter json;
  json.begin_object()
      .field("source", view.source)
      .key("t_s")
      .raw(text::seconds_text(view.wall_ns))
      .field("replayed_here", view.computed_here)
      .field("link", link_text(view.link))
      .field("frames_per_s", view.traffic.frames_per_s)
      .field("bit_per_s", view.traffic.bit_per_s)
      .field("bitrate", or_null(view.traffic.bitrate))
      .field("silence_s", or_null(view.silence_s))
      .field("wrong_crc", view.distrust.wrong_crc)
      .field("wrong_counter", view.distrust.wrong_sequence)
      .field("other_version", view.distrust.foreign_version)
      .field("state", view.state)
      .field("phase", view.phase)
      .field("macro_slip_stop", view.stop)
      .field("outcome", view.outcome)
      .field("stop_reason", view.reason);
  add_reasons(json, "faults", view.faults);
  if (view.inhibits_known) {
    add_reasons(json, "inhibits", view.inhibits);
  } else {
    json.key("inhibits").null();
  }
  json.field("mu_star", or_null(view.mu_star))
      .field("sigma_star_percent", or_null(view.sigma_star_percent))
      .field("friction_slope", or_null(view.friction_slope))
      .field("force_asked_N", or_null(view.force_asked_N))
      .field("force_given_N", or_null(view.force_given_N))
      .field("min_clamp_force_N", or_null(view.force_least_N));
  add_friction(json, view.friction);
  add_carried(json, view);
  json.field("experiment_count", view.experiment_count);
  add_experiments(json, view);
  add_inputs(json, view);
  json.end_object();
  return json.take() + "\n";
}

}  // namespace beltgrip::monitor
