#include "tools/monitor/session.h"

namespace beltgrip::monitor {

namespace {

// Who watches asks for nothing, no ECU either. On a bus preconditions are judged as for observing:
// what only a request needs, the daemon's own frames say.
daemon::Config watching(daemon::Config config, Session::Source source) {
  config.diagnostics = daemon::Diagnostics::kListen;
  if (source == Session::Source::kBus) config.control = daemon::Control::kObserve;
  return config;
}

}  // namespace

Session::Session(Source source, const daemon::FrameIdentifiers& identifiers,
                 const std::optional<daemon::Config>& config)
    : source_(source), bus_(identifiers) {
  if (!config) return;
  here_ = std::make_unique<BusModel>(identifiers);
  shadow_ = std::make_unique<Shadow>(watching(*config, source),
                                     [this](daemon::MonoTime t, const can::CanFrame& frame) {
                                       if (computes()) here_->on_own_frame(t, frame);
                                     });
}

void Session::on_frame(const daemon::RxFrame& frame) {
  const bool own = frame.bus == 0 && bus_.is_own(frame.frame);
  if (frame.bus == 0) {
    bus_.on_lost(frame.dropped_before);
    bus_.on_frame(frame.t, frame.frame);
  }
  recorded_ = recorded_ || own;
  if (shadow_ && !own) shadow_->on_frame(frame);
}

void Session::on_link(daemon::BusState state) {
  link_ = state;
  if (shadow_) shadow_->on_link(state);
}

void Session::advance(daemon::MonoTime now) {
  if (shadow_) shadow_->advance(now);
}

void Session::show(View& view, daemon::MonoTime now) const {
  view.t_ns = now.ns();
  view.link = link_;
  bus_.show(view, now);
  view.computed_here = shadow_ && computes();
  if (view.computed_here) {
    const Traffic traffic = view.traffic;
    here_->show(view, now);
    view.traffic = traffic;
  }
  if (shadow_) shadow_->show(view, now);
}

}  // namespace beltgrip::monitor
