"""What the two recipes share: the program, a folder of sealed truth, the answers to it."""
import argparse
import csv
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import score

BUILD = Path(__file__).parents[2] / "build"
PROGRAM = os.environ.get("BELTGRIP", str(BUILD / "bin/beltgrip"))
# sysexits, as the program's own.
UNUSABLE, MISSING, INTERNAL, NOT_CREATED = 65, 66, 70, 73


class Refused(Exception):
    """One line for the user, and the exit code."""

    def __init__(self, code, text):
        super().__init__(text)
        self.code = code


def call(*arguments, program=PROGRAM):
    """Standard output of the program."""
    words = [str(each) for each in (program, *arguments)]
    try:
        done = subprocess.run(words, capture_output=True, text=True)
    except OSError as error:
        raise Refused(MISSING, f"{program}: {error.strerror}; expected a program that is built") from None
    if done.returncode != 0:
        said = done.stderr.strip().splitlines() or ["nothing"]
        raise Refused(INTERNAL, f"{' '.join(words)}: exit {done.returncode}, {said[-1]}")
    return done.stdout


def run(main):
    """main's exit status; what it refuses as one line."""
    try:
        return main()
    except Refused as error:
        print(f"{Path(sys.argv[0]).name}: {error}", file=sys.stderr)
        return error.code


def hashes(folder):
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted(folder.iterdir())}


def write(kind, count, make, about):
    """COUNT folders by make(number, seed, folder), which gives (truth, what is told of it)."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=count)
    parser.add_argument("--seed", type=int, default=2011)
    given = parser.parse_args()
    if given.count < 1:
        parser.error(f"argument --count: found {given.count}, expected 1 or more")
    try:
        given.folder.mkdir(parents=True)
    except OSError as error:
        raise Refused(NOT_CREATED, f"{given.folder}: {error.strerror}; expected a new folder") from None
    truths, entries = {}, {}
    for number in range(given.count):
        name = f"{number:03d}"
        folder = given.folder / name
        truths[name], told = make(number, given.seed, folder)
        entries[name] = {**told, "files": hashes(folder)}
    text, digest = score.seal(truths)
    (given.folder / "truth.sealed").write_text(text)
    manifest = {"type": kind, "seed": given.seed, "program": call("--version").strip(),
                "truth_sha256": digest, kind: entries}
    (given.folder / "manifest.json").write_text(json.dumps(manifest, indent=1, sort_keys=True) + "\n")
    return 0


def answer(kind, methods, about):
    """CSV of methods[name](folder) for each entry of a folder that write() made."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("folder", type=Path)
    parser.add_argument("method", choices=tuple(methods))
    given = parser.parse_args()
    path = given.folder / "manifest.json"
    try:
        manifest, found = score.read_manifest(path)
    except OSError as error:
        raise Refused(MISSING, f"{path}: {error.strerror}; expected a folder of make.py") from None
    except ValueError as error:
        raise Refused(UNUSABLE, str(error)) from None
    if found != kind:
        raise Refused(UNUSABLE, f"{path}: found {found}, expected {kind}")
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(score.COLUMNS[kind])
    for name in manifest[kind]:
        found = methods[given.method](given.folder / name)
        out.writerow([name, *("" if v is None else v for v in found)])
    return 0
