#!/usr/bin/python3
"""answer_campaigns.py FOLDER METHOD: answers to the campaigns in FOLDER, as CSV on standard output.

METHOD: diagnose as shipped; two that must lose: nothing (never anything wrong) and usual (always a
gain of the torque sensor).
"""
import json
import sys

import recipe


def diagnose(folder):
    logs = sorted(folder.glob("run*.csv"))
    found = json.loads(recipe.call("diagnose", "--config", folder / "config.toml", *logs, "--json",
                                   "-"))
    if not found["findings"]:
        return found["verdict"], "", "", "", "", ""
    first = found["findings"][0]
    # The parameter that is furthest from nothing, by its interval.
    name, size = max(first["parameters"].items(), key=lambda each: abs(each[1]["value"]) /
                     max(each[1]["ci95"][1] - each[1]["ci95"][0], 1e-300))
    return found["verdict"], first["effect"], name, size["value"], *size["ci95"]


METHODS = {"diagnose": diagnose,
           "nothing": lambda _: ("nothing_wrong", "", "", "", "", ""),
           "usual": lambda _: ("explained", "torque_gain", "gain", "", "", "")}


def main():
    return recipe.answer("campaigns", METHODS, __doc__)


if __name__ == "__main__":
    sys.exit(recipe.run(main))
