#!/usr/bin/python3
"""score.py FOLDER ANSWERS.csv...: how good answers are. FOLDER is what make.py wrote.

Experiments: id,stop_s,mu_max,lo,hi,kind with kind value, lower_bound or none; empty where there is
none. Campaigns: id,verdict,effect,parameter,value,lo,hi. One row an id. Prints one row of a Markdown
table for each file; --by noise, plant, kind or family: one for each class of it as well.
"""
import argparse
import base64
import csv
import hashlib
import json
import math
import sys
import zlib
from pathlib import Path

EARLY_SHARE = 0.8  # of the slip at the peak: a stop before it is early (near_s in the truth)
LATE_PERCENT = 1.0  # slip past the peak, in points, that is still in time
# How far from the truth an interval or a bound may reach and still be of use: the usual safety factor
# of the clamp force. Who knows no more than that has nothing to save.
USEFUL_FACTOR = 1.3
COLUMNS = {
    "experiments": ("id", "stop_s", "mu_max", "lo", "hi", "kind"),
    "campaigns": ("id", "verdict", "effect", "parameter", "value", "lo", "hi"),
}
HEADERS = {
    "experiments": ("answers", "right", "stops", "early", "slip past the peak, 50 / 90 %", "values",
                    "error, 50 / 95 %", "half width, 50 / 95 %", "truth in the interval", "bounds right",
                    "no peak: a value that misses"),
    "campaigns": ("answers", "right", "cause named", "cause within its interval",
                  "false alarms without a cause"),
}


def seal(truth):
    """(text of truth.sealed, its hash). Stored, not packed: the same bytes with every zlib."""
    text = base64.encodebytes(zlib.compress(json.dumps(truth, sort_keys=True).encode(), 0)).decode()
    return text, hashlib.sha256(text.encode()).hexdigest()


def unseal(text, digest):
    found = hashlib.sha256(text.encode()).hexdigest()
    if found != digest:
        raise ValueError(f"truth.sealed: sha256 {found}, manifest.json says {digest}")
    return json.loads(zlib.decompress(base64.decodebytes(text.encode())))


def read_manifest(path):
    """What make.py or make_campaigns.py wrote, and of which kind it is."""
    try:
        manifest = json.loads(path.read_text())
        kind, _ = manifest["type"], manifest["truth_sha256"]
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path}: {error!r}, expected what make.py writes") from None
    if kind not in COLUMNS:
        raise ValueError(f"{path}: type: found {kind!r}, expected {' or '.join(COLUMNS)}")
    return manifest, kind


def number(text, where):
    if text.strip() == "":
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{where}: found {text!r}, expected a number or nothing")
    return value


def read_answers(path, columns, numbers):
    answers = {}
    with open(path, newline="", encoding="utf-8-sig", errors="replace") as file:
        reader = csv.DictReader(file)
        if tuple(reader.fieldnames or ()) != columns:
            raise ValueError(f"{path}:1: found {','.join(reader.fieldnames or ())}, "
                             f"expected {','.join(columns)}")
        for row in reader:
            where = f"{path}:{reader.line_num}"
            if row["id"] in answers:
                raise ValueError(f"{where}: {row['id']} is answered twice")
            if None in row or None in row.values():
                raise ValueError(f"{where}: expected {len(columns)} fields")
            answers[row["id"]] = {k: number(v, f"{where}: {k}") if k in numbers else v.strip()
                                  for k, v in row.items()}
    return answers


def quantile(values, share):
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def share(flags):
    flags = list(flags)
    return f"{100.0 * sum(flags) / len(flags):.0f} % of {len(flags)}" if flags else "none"


def pair(values, shares, unit):
    if not values:
        return "none"
    return " / ".join(f"{quantile(values, s):.2f}" for s in shares) + unit


def slip_at(course, t_s):
    """Slip* on the truth's course, by straight lines, level beyond its ends."""
    for (t0, s0), (t1, s1) in zip(course, course[1:]):
        if t0 <= t_s <= t1:
            return s0 + (s1 - s0) * (t_s - t0) / (t1 - t0)
    return course[0][1] if t_s < course[0][0] else course[-1][1]


def judge_experiment(truth, answer):
    """What is to be counted of one answer."""
    value, bound = (answer["kind"] == each for each in ("value", "lower_bound"))
    peak, stops = truth["peak_s"] is not None, answer["stop_s"] is not None
    judged = {"peak": peak, "stops": stops, "value": value, "bound": bound}
    reference = truth["mu_max"]
    known = False  # something true and of use is said of mu_max
    if value:
        low, high = answer["lo"], answer["hi"]
        judged["error"] = 100.0 * abs(answer["mu_max"] / reference - 1.0)
        judged["width"] = 50.0 * (high - low) / reference
        judged["held"] = low <= reference <= high
        known = (judged["held"] and low * USEFUL_FACTOR >= reference and
                 high <= USEFUL_FACTOR * reference)
    if bound:
        judged["bound_right"] = answer["mu_max"] <= reference
        known = judged["bound_right"] and answer["mu_max"] * USEFUL_FACTOR >= reference
    if not peak:
        judged["misses"] = value and not judged["held"]
        judged["right"] = known
        return judged
    late = True
    if stops:
        judged["early"] = answer["stop_s"] < truth["near_s"]
        judged["past"] = (slip_at(truth["course"], answer["stop_s"]) -
                          slip_at(truth["course"], truth["peak_s"]))
        late = judged["past"] > LATE_PERCENT
    if truth["kind"] == "disturbed" and not value:
        # To stop from then on, early or not, and to give no value is an answer.
        judged["right"] = (not late and answer["stop_s"] >= truth["disturbed_s"] and
                           judged.get("bound_right", True))
    else:
        judged["right"] = not late and not judged["early"] and value and known
    return judged


def experiment_cells(truths, answers):
    judged = [judge_experiment(t, answers[i]) for i, t in truths.items()]
    peaked = [j for j in judged if j["peak"]]
    stopped = [j for j in peaked if j["stops"]]
    values = [j for j in peaked if j["value"]]
    return [share(j["right"] for j in judged), share(j["stops"] for j in peaked),
            share(j["early"] for j in stopped),
            pair([j["past"] for j in stopped], (0.5, 0.9), " points"),
            share(j["value"] for j in peaked), pair([j["error"] for j in values], (0.5, 0.95), " %"),
            pair([j["width"] for j in values], (0.5, 0.95), " %"),
            share(j["held"] for j in values),
            share(j["bound_right"] for j in judged if j["bound"]),
            share(j["misses"] for j in judged if not j["peak"])]


def judge_campaign(truth, answer):
    cause = truth["effect"]
    named = answer["effect"] == cause
    size = truth["parameters"].get(answer["parameter"]) if cause else None
    within = (named and size is not None and answer["lo"] is not None and
              answer["hi"] is not None and answer["lo"] <= size <= answer["hi"])
    quiet = answer["verdict"] == "nothing_wrong"
    return {"cause": bool(cause), "named": named, "within": within, "alarm": not quiet,
            "right": named if cause else quiet}


def campaign_cells(truths, answers):
    judged = [judge_campaign(t, answers[i]) for i, t in truths.items()]
    causes = [j for j in judged if j["cause"]]
    return [share(j["right"] for j in judged), share(j["named"] for j in causes),
            share(j["within"] for j in causes if j["named"]),
            share(j["alarm"] for j in judged if not j["cause"])]


def check_answers(kind, path, answers, truths):
    for name in truths:
        if name not in answers:
            raise ValueError(f"{path}: no row for {name}; {len(truths)} are expected")
    for name, answer in answers.items():
        if name not in truths:
            raise ValueError(f"{path}: {name} is not in the manifest")
        if kind == "experiments":
            needed = {"value": ("mu_max", "lo", "hi"), "lower_bound": ("mu_max",), "none": ()}
            if answer["kind"] not in needed:
                raise ValueError(f"{path}: {name}: found kind {answer['kind']!r}, expected value, "
                                 "lower_bound or none")
            for each in needed[answer["kind"]]:
                if answer[each] is None:
                    raise ValueError(f"{path}: {name}: a {answer['kind']} needs {each}")
        low, high = answer["lo"], answer["hi"]
        if low is not None and high is not None and low > high:
            raise ValueError(f"{path}: {name}: lo {low:g} lies above hi {high:g}")


def table(folder, paths, by=None):
    """Lines of the Markdown table."""
    manifest, kind = read_manifest(folder / "manifest.json")
    if by and kind != "experiments":
        raise ValueError(f"--by {by}: {kind} have no classes that may be told")
    truths = unseal((folder / "truth.sealed").read_text(), manifest["truth_sha256"])
    cells = experiment_cells if kind == "experiments" else campaign_cells
    numbers = ("stop_s", "mu_max", "lo", "hi", "value")
    yield "| " + " | ".join(HEADERS[kind]) + " |\n" + "|---" * len(HEADERS[kind]) + "|"
    for path in paths:
        answers = read_answers(path, COLUMNS[kind], numbers)
        check_answers(kind, path, answers, truths)
        yield f"| {path.stem} | " + " | ".join(cells(truths, answers)) + " |"
        for group in sorted({t[by] for t in truths.values()}) if by else ():
            some = {i: t for i, t in truths.items() if t[by] == group}
            yield f"| {path.stem}, {group} | " + " | ".join(cells(some, answers)) + " |"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("answers", nargs="+", type=Path)
    parser.add_argument("--by", choices=("noise", "plant", "kind", "family"))
    given = parser.parse_args()
    try:
        for line in table(given.folder, given.answers, given.by):
            print(line)
    except OSError as error:
        print(f"score.py: {error.filename}: {error.strerror}", file=sys.stderr)
        return 66
    except ValueError as error:
        print(f"score.py: {error}", file=sys.stderr)
        return 65
    return 0


if __name__ == "__main__":
    sys.exit(main())
