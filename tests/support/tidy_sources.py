#!/usr/bin/env python3
"""tidy_sources.py BUILD FOLDER: what clang-tidy reads of the product, a file a line, and in FOLDER how each is
compiled. A file stands for a room's sources in eights, as BUILD compiles them, or for all of several rooms:
nine tenths of what clang-tidy reads are headers of the system, and these it then reads once. Fails where a source
of the product is in none."""
import json
import pathlib
import re
import shlex
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
ROOMS = ("can_dbc", "estimator", "daemon", "tools")
# Rooms that are read together, by the beginnings of their targets' names. All others are read in eights: some of
# their sources give the same name to different things, each for itself.
TOGETHER = (
    "can_dbc_(frame|text|uds)",
    "estimator_(belt|choice|paper|physics|record|signal|statistics)",
    "daemon_core_config",
    "daemon_core_experiment",
    "daemon_core_(base|estimate|guard|loop|observe|reasons)",
    "daemon_(io|command_line)|beltgripd$",
    "tools_(calibrate|check|ports|report|table)",
    "tools_monitor",
)


def places(command):
    """Where a compiler's command looks for headers."""
    words = shlex.split(command)
    return [each for at, each in enumerate(words) if each.startswith("-I") or "-isystem" in (each, words[at - 1])]


def main(build, folder):
    folder.mkdir(parents=True, exist_ok=True)
    compiled, left = [], []
    for each in json.loads((build / "compile_commands.json").read_text()):
        path = pathlib.Path(each["file"])
        # What tests compile anew of the product, headers compiled before all others, C.
        if re.search(r" -o (\S+/)?tests/", each["command"]) or path.suffix not in (".cpp", ".cxx") \
                or path.name == "cmake_pch.hxx.cxx" or path.name.startswith("beltgrip_headers"):
            continue
        compiled.append(each)
    seen = set()
    for each in compiled:
        path = pathlib.Path(each["file"])
        seen.add(str(path))
        if path.name.startswith("unity_"):
            seen.update(re.findall(r'^#include "(.*\.cpp)"$', path.read_text(), re.MULTILINE))
    left = [str(path) for room in ROOMS for path in sorted((ROOT / room).rglob("*.cpp")) if str(path) not in seen]
    if left:
        sys.exit(f"{build}: compiles nothing of " + ", ".join(left))
    groups = {}
    for each in compiled:
        target = re.search(r"/(\w+)\.dir/", shlex.split(each["command"])[-3])
        room = next((name for name in TOGETHER if target and re.match(name, target[1])), each["file"])
        groups.setdefault(room, []).append(each)
    commands = []
    for room, members in groups.items():
        first = members[0]
        if len(members) > 1:
            path = folder / (re.sub(r"\W+", "_", room).strip("_") + ".cpp")
            path.write_text("".join(f'#include "{each["file"]}"\n' for each in members))
            shown = " ".join(place for each in members for place in places(each["command"]))
            first = {"directory": first["directory"], "file": str(path),
                     "command": first["command"].rsplit(" -c ", 1)[0] + f" {shown} -c {path}"}
        commands.append(first)
    (folder / "compile_commands.json").write_text(json.dumps(commands, indent=1))
    print("\n".join(each["file"] for each in commands))


main(pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve())
