#!/usr/bin/python3
"""make.py FOLDER [--count 120] [--seed 2011]: the experiments of the benchmark.

Each is a folder: trace.log, vehicle.dbc, beltgrip.toml. manifest.json names them with their hashes,
truth.sealed is for score.py. Same seed and same program, same bytes. BELTGRIP names the program.
"""
import json
import os
import sys
import tempfile
from pathlib import Path

import draw
import recipe
import score
from recipe import call

TRIES = 60  # drawings until the peak is passed (with a peak) or there was a ramp (without)
HEAD_S = 30.0  # of the rig's log before the peak
LAG_S = 0.045  # of the low-pass of method "paper", which the course is read through
COURSE_STEP = 10  # samples of 5 ms
KEPT = ("trace.log", "vehicle.dbc", "beltgrip.toml")


def course_of(folder, begin_s, end_s):
    """Slip* over time. Nothing is ever wrong with the speeds of this benchmark."""
    trace = folder / "trace.csv"
    call("replay", folder / "trace.log", "--config", folder / "beltgrip.toml", "--method", "paper",
         "--trace", trace, "--json", os.devnull)
    rows = [line.split(",") for line in trace.read_text().splitlines()[1:]]
    trace.unlink()
    points = [(round(float(r[0]) - LAG_S, 3), round(float(r[2]), 3)) for r in rows]
    return [p for p in points if begin_s <= p[0] <= end_s][::COURSE_STEP]


def configure(folder, plant, kind):
    """Nobody asks the car again; a rig whose sensors are biased says how much they may be."""
    path = folder / "beltgrip.toml"
    lines = []
    for line in path.read_text().splitlines():
        if line.startswith("control"):
            line = 'control = "observe"'
        if plant == "rig" and kind == "biased":
            if line.startswith("primary_torque     = {"):
                line = f"primary_torque     = {{ bias_Nm = 0, gain = {draw.TORQUE_GAIN} }}"
            elif line.startswith("secondary_pressure = {"):
                line = f"secondary_pressure = {{ bias_Pa = {draw.PRESSURE_BIAS_PA}, gain = 0 }}"
        lines.append(line)
    path.write_text("\n".join(lines) + "\n")


def attempt(random, number, folder):
    """One drawing into FOLDER: its truth, or None where it is of no use."""
    plant, noise, family, kind = draw.combination(number)
    text, belt, steps_s = (draw.draw_rig if plant == "rig" else draw.draw_car)(random, noise, family, kind)
    scenario = folder / "scenario.toml"
    scenario.write_text(text)
    seed = 1 + number
    plain = json.loads(call("simulate", "--scenario", scenario, "--seed", seed, "--json",
                            "-").splitlines()[-2])
    runs = plain["experiments" if plant == "rig" else "requests"]
    if not runs:
        return None
    run = runs[0]
    rising = family == "rising"
    peak_s = None if rising else run["peak_s"]
    end_s = run.get("let_go_s") or run.get("end_s") or 1e9
    if peak_s is None and not rising:
        return None
    options = []
    if plant == "rig":
        about_s = peak_s if peak_s is not None else (run.get("let_go_s") or HEAD_S)
        options = ["--start", max(0.0, about_s - HEAD_S)]
    call("simulate", "--scenario", scenario, "--seed", seed, "--out-dir", folder, "--force", *options)
    configure(folder, plant, kind)
    truth = {"plant": plant, "noise": noise, "family": family, "kind": kind, "peak_s": peak_s,
             "mu_max": run["mu_max"]}
    if steps_s is not None:
        truth["disturbed_s"] = steps_s + (0.0 if plant == "rig" else run["begin_s"])
    if rising:
        # What friction has come to at 10 % of slip.
        truth["mu_max"] -= belt["rise_per_percent"] * (draw.RISING_TO_PERCENT - 10.0)
        return truth
    truth["course"] = course_of(folder, peak_s - 3.0, end_s + 2.0)
    if len(truth["course"]) < 20 or truth["course"][-1][0] < peak_s:
        return None
    near = score.EARLY_SHARE * score.slip_at(truth["course"], peak_s)
    truth["near_s"] = next(t for t, slip in truth["course"] if slip >= near)
    return truth


def make(number, seed, target):
    random = draw.Random(1_000_003 * seed + number)
    for _ in range(TRIES):
        with tempfile.TemporaryDirectory(dir=target.parent) as name:
            place = Path(name)
            truth = attempt(random, number, place)
            if truth is None:
                continue
            target.mkdir()
            for each in KEPT:
                (place / each).rename(target / each)
            return truth, {"plant": truth["plant"], "noise": truth["noise"]}
    raise recipe.Refused(recipe.INTERNAL,
                         f"experiment {number}: no drawing of {TRIES} reaches its peak")


def main():
    return recipe.write("experiments", 120, make, __doc__)


if __name__ == "__main__":
    sys.exit(recipe.run(main))
