#!/usr/bin/python3
"""answer.py FOLDER METHOD: answers to the experiments in FOLDER, as CSV on standard output.

METHOD: robust and paper as shipped; three that must lose: largest (the largest mu* behind a low-pass
of 5 Hz), end (mu* where the clamp force was least) and nothing (stop at once, say nothing).
"""
import csv
import json
import sys
import tempfile
from functools import partial
from pathlib import Path

import recipe

WIDTH = 0.02  # of the answers that know no interval


def replay(folder, method, *trace):
    text = recipe.call("replay", folder / "trace.log", "--config", folder / "beltgrip.toml",
                       "--method", method, *trace, "--json", "-")
    found = [json.loads(line) for line in text.splitlines()]
    return [each for each in found if each["type"] == "experiment"]


def by_method(method, folder):
    experiments = replay(folder, method)
    if not experiments:
        return None, None, None, None, "none"
    found = max(experiments, key=lambda each: each["samples"])
    if found["mu_max"] is not None:
        return found["stop_s"], found["mu_max"], *found["mu_max_ci95"], "value"
    if found["mu_max_lower_bound"] is not None:
        return found["stop_s"], found["mu_max_lower_bound"], None, None, "lower_bound"
    return found["stop_s"], None, None, None, "none"


def trivial(method, folder):
    with tempfile.TemporaryDirectory() as name:
        trace = Path(name) / "trace.csv"
        replay(folder, "paper", "--trace", trace)
        with open(trace, newline="") as file:
            rows = [(float(r["t_s"]), float(r["mu_star"]), float(r["clamp_force_N"]))
                    for r in csv.DictReader(file)]
    if not rows:
        return None, None, None, None, "none"
    # Neither knows before the ramp is over.
    t_s, mu, _ = min(rows, key=lambda r: r[2])
    if method == "largest":
        mu = max(r[1] for r in rows)
    return t_s, mu, (1.0 - WIDTH) * mu, (1.0 + WIDTH) * mu, "value"


METHODS = {"robust": partial(by_method, "robust"), "paper": partial(by_method, "paper"),
           "largest": partial(trivial, "largest"), "end": partial(trivial, "end"),
           "nothing": lambda _: (0.0, None, None, None, "none")}


def main():
    return recipe.answer("experiments", METHODS, __doc__)


if __name__ == "__main__":
    sys.exit(recipe.run(main))
