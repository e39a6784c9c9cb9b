#!/usr/bin/python3
"""answer_campaigns.py FOLDER METHOD: answers to the campaigns in FOLDER, as CSV on standard output.

METHOD: diagnose as shipped; two that must lose: nothing (never anything wrong) and usual (always a
gain of the torque sensor).
"""
import argparse
import csv
import json
import subprocess
import sys
from pathlib import Path

from make import PROGRAM
from score import COLUMNS

TRIVIAL = {"nothing": ("nothing_wrong", "", "", "", "", ""),
           "usual": ("explained", "torque_gain", "gain", "", "", "")}


def diagnose(folder):
    logs = sorted(str(path) for path in folder.glob("run*.csv"))
    done = subprocess.run([PROGRAM, "diagnose", "--config", folder / "config.toml", *logs, "--json",
                           "-"], capture_output=True, text=True, check=True)
    found = json.loads(done.stdout)
    if not found["findings"]:
        return found["verdict"], "", "", "", "", ""
    first = found["findings"][0]
    # The parameter that is furthest from nothing, by its interval.
    name, size = max(first["parameters"].items(), key=lambda each: abs(each[1]["value"]) /
                     max(each[1]["ci95"][1] - each[1]["ci95"][0], 1e-300))
    return found["verdict"], first["effect"], name, size["value"], *size["ci95"]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("method", choices=("diagnose", *TRIVIAL))
    given = parser.parse_args()
    manifest = json.loads((given.folder / "manifest.json").read_text())
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(COLUMNS["campaigns"])
    for each in manifest["campaigns"]:
        out.writerow([each, *(TRIVIAL.get(given.method) or diagnose(given.folder / each))])
    return 0


if __name__ == "__main__":
    sys.exit(main())
