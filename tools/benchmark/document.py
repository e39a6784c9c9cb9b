#!/usr/bin/python3
"""document.py DATA CAMPAIGNS [ANSWERS]: all answers to both data sets, scored, into the tables of
tools/BENCHMARK.md. The answers stay in the folder ANSWERS; those that it has already are taken.
"""
import argparse
import re
import sys
import tempfile
from pathlib import Path

import answer
import answer_campaigns
import recipe
import score

HERE = Path(__file__).parent
DOCUMENT = HERE.parent / "BENCHMARK.md"
TABLE = re.compile(r"(?:^\|.*\n)+", re.M)
STAMP = re.compile(r"(?<=Seed )\d+ \([^)]*\)")


def answers_of(script, methods, data, folder):
    paths = []
    for method in methods:
        path = folder / script.removesuffix(".py") / f"{method}.csv"
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            path.write_text(recipe.call(data, method, program=HERE / script))
        paths.append(path)
    return paths


def classes(data, paths):
    """Rows of the methods that are no trivial ones, by kind and by plant."""
    lines = list(score.table(data, paths, "kind"))
    for by in ("kind", "plant"):
        lines += [line for line in score.table(data, paths, by) if re.match(r"\| \w+, ", line)
                  and line not in lines]
    return [line for line in lines if not re.match(r"\| \w+ \|(?! right)", line)]


def write(tables, stamp):
    """The tables in the places of those that begin with the same cell, in their order."""
    left = ["\n".join(lines) + "\n" for lines in tables]
    text = DOCUMENT.read_text()

    def place(found):
        return left.pop(0) if found.group().startswith("| answers |") else found.group()

    text = STAMP.sub(stamp, TABLE.sub(place, text))
    if left:
        raise recipe.Refused(recipe.INTERNAL, f"{DOCUMENT}: {len(left)} tables have no place")
    DOCUMENT.write_text(text)


def program_commit():
    """The last commit that changed the program's sources."""
    return recipe.call("-C", HERE.parents[1], "log", "-1", "--format=%h", "--", "*.cpp", "*.h", ":!tests",
                       program="git").strip()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("campaigns", type=Path)
    parser.add_argument("answers", type=Path, nargs="?")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = given.answers or Path(name)
        experiments = answers_of("answer.py", answer.METHODS, given.data, folder)
        campaigns = answers_of("answer_campaigns.py", answer_campaigns.METHODS, given.campaigns, folder)
        tables = [list(score.table(given.data, experiments)), classes(given.data, experiments[:2]),
                  list(score.table(given.campaigns, campaigns))]
    manifest, _ = score.read_manifest(given.data / "manifest.json")
    write(tables, f"{manifest['seed']} ({program_commit()})")
    return 0


if __name__ == "__main__":
    sys.exit(recipe.run(main))
