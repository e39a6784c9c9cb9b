#!/usr/bin/python3
"""make_campaigns.py FOLDER [--count 60] [--seed 2011]: campaigns for what is wrong with a machine.

Each is a folder: twelve experiments run*.csv on a rig and config.toml, every third without a hidden
cause. manifest.json names them with their hashes, truth.sealed is for score.py. The machine is that
of the blind test (build/tests/generate, or GENERATE), which shares no model with beltgrip diagnose.
"""
import argparse
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import draw
import score

GENERATE = os.environ.get("GENERATE", str(Path(__file__).parents[2] / "build/tests/generate"))
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
    arguments = [GENERATE, str(folder), str(10_000 * seed + number)]
    cause = random.pick(CAUSES) if number % 3 else None
    if cause:
        arguments += [cause, f"{random.log_uniform(*SIZES):.3f}"]
    subprocess.run(arguments, check=True)
    written = folder / "truth.txt"
    truth = {"effect": None, "parameters": {}}
    for line in written.read_text().splitlines():
        if not line.startswith("#"):
            name, value = line.split(" = ")
            truth["effect"], parameter = name.split("@")[0].split(".")
            truth["parameters"][parameter] = float(value)
    written.unlink()
    files = {path.name: hashlib.sha256(path.read_bytes()).hexdigest()
             for path in sorted(folder.iterdir())}
    return truth, files


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=2011)
    given = parser.parse_args()
    given.folder.mkdir(parents=True)
    truths, entries = {}, {}
    for number in range(given.count):
        name = f"{number:03d}"
        truths[name], files = make(number, given.seed, given.folder / name)
        entries[name] = {"files": files}
    text, digest = score.seal(truths)
    (given.folder / "truth.sealed").write_text(text)
    manifest = {"type": "campaigns", "seed": given.seed, "truth_sha256": digest,
                "campaigns": entries}
    (given.folder / "manifest.json").write_text(json.dumps(manifest, indent=1, sort_keys=True) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
