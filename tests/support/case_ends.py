#!/usr/bin/env python3
"""case_ends.py FILE...: of each case that the campaign wrote, a line: seed, how its experiments ended as
one word, how many promises it broke, its largest slip in percent.
"""
import json
import sys

for path in sys.argv[1:]:
    with open(path, encoding="utf-8") as lines:
        for case in map(json.loads, lines):
            if "seed" not in case:
                continue
            ends = [each["outcome"] + each["stop_reason"] for each in case.get("experiments", [])]
            print(case["seed"], "+".join(ends) or "-", len(case.get("violations", [])),
                  case.get("slip_max_percent", 0.0))
