#!/usr/bin/python3
"""make_campaigns.py FOLDER [--count 60] [--seed 2011]: campaigns for what is wrong with a machine.

Each is a folder: twelve experiments run*.csv on a rig and config.toml, every third without a hidden
cause. manifest.json names them with their hashes, truth.sealed is for score.py. The machine is that
of the blind test (build/tests/generate, or GENERATE), which shares no model with beltgrip diagnose.
"""
import os
import sys

import draw
import recipe

GENERATE = os.environ.get("GENERATE", str(recipe.BUILD / "tests/generate"))
SIZES = (0.7, 2.0)  # times the size that is met in practice
CAUSES = ("torque_bias.bias_Nm", "torque_gain.gain", "torque_loss.per_kN_Nm",
          "torque_loss.constant_Nm", "torque_loss.per_rad_s_Nm",
          "centrifugal_force.coefficient_N_s2", "pressure_offset.offset_Pa", "pressure_gain.gain",
          "clamp_hysteresis.force_N", "pulley_deformation.per_kN", "radius_tilt.per_Nm",
          "end_stop_ratio.overdrive", "friction_temperature.per_K", "friction_speed.per_ln_speed",
          "friction_ratio.relative", "wear.step", "wear.per_experiment", "speed_scale.primary",
          "speed_ripple.primary", "channel_skew.delay_s")


def make(number, seed, folder):
    random = draw.Random(7_000_003 * seed + number)
    arguments = [folder, 10_000 * seed + number]
    cause = random.pick(CAUSES) if number % 3 else None
    if cause:
        arguments += [cause, f"{random.log_uniform(*SIZES):.3f}"]
    recipe.call(*arguments, program=GENERATE)
    written = folder / "truth.txt"
    truth = {"effect": None, "parameters": {}}
    for line in written.read_text().splitlines():
        if not line.startswith("#"):
            name, value = line.split(" = ")
            truth["effect"], parameter = name.split("@")[0].split(".")
            truth["parameters"][parameter] = float(value)
    written.unlink()
    return truth, {}


def main():
    return recipe.write("campaigns", 60, make, __doc__)


if __name__ == "__main__":
    sys.exit(recipe.run(main))
