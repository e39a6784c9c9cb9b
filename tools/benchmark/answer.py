#!/usr/bin/python3
"""answer.py FOLDER METHOD: answers to the experiments in FOLDER, as CSV on standard output.

METHOD: robust and paper as shipped; two that must lose: largest (the largest mu* behind a low-pass
of 5 Hz) and end (mu* where the clamp force was least).
"""
import argparse
import csv
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from make import PROGRAM
from score import COLUMNS

METHODS = ("robust", "paper", "largest", "end")
WIDTH = 0.02  # of the answers that know no interval


def replay(folder, method, trace):
    done = subprocess.run([PROGRAM, "replay", folder / "trace.log", "--config",
                           folder / "beltgrip.toml", "--method", method, "--trace", trace, "--json",
                           "-"], capture_output=True, text=True, check=True)
    found = [json.loads(line) for line in done.stdout.splitlines()]
    return [each for each in found if each["type"] == "experiment"]


def by_method(folder, method, trace):
    experiments = replay(folder, method, trace)
    if not experiments:
        return None, None, None, None, "none"
    found = max(experiments, key=lambda each: each["samples"])
    if found["mu_max"] is not None:
        return found["stop_s"], found["mu_max"], *found["mu_max_ci95"], "value"
    if found["mu_max_lower_bound"] is not None:
        return found["stop_s"], found["mu_max_lower_bound"], None, None, "lower_bound"
    return found["stop_s"], None, None, None, "none"


def trivial(folder, method, trace):
    replay(folder, "paper", trace)
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


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("method", choices=METHODS)
    given = parser.parse_args()
    manifest = json.loads((given.folder / "manifest.json").read_text())
    answer = by_method if given.method in ("robust", "paper") else trivial
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(COLUMNS["experiments"])
    with tempfile.TemporaryDirectory() as name:
        for each in manifest["experiments"]:
            found = answer(given.folder / each, given.method, Path(name) / "trace.csv")
            out.writerow([each, *("" if v is None else v for v in found)])
    return 0


if __name__ == "__main__":
    sys.exit(main())
