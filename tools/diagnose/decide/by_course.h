// Names by what takes another course in the residuals. A hypothesis weighs the noise of a sample by
// what it makes of it in torque, and over thousands of samples that is worth tens of nats by which
// nothing is told apart: an offset of the pressure from a force of the turning oil at one speed.
#pragma once

#include <string_view>

#include "tools/diagnose/infer/engine.h"

namespace beltgrip::diagnose {

// What an effect follows (EffectRow::depends_on) is no rate, no direction and no angle, so that
// what it explains lies in a slow course. Of the others single samples tell.
bool is_slow(std::string_view depends_on);
bool is_slow(const Engine& engine, int slot);

// Of the log evidence by which a name (a slot and its fit) is ahead of a rival in its place: what
// lies in no course of the residuals. 0 where either is not slow, where one of both fits is no
// machine, and where the rival is far behind.
double ahead_by_noise(const Engine& engine, int name, const Hypothesis& with_name, int rival,
                      const Hypothesis& with_rival);

// Most of what one fit gains over another lies in no course of the residuals.
bool is_of_noise(const Engine& engine, const Hypothesis& without, const Hypothesis& with);

}  // namespace beltgrip::diagnose
