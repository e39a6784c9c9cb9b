#!/usr/bin/env python3
"""compiled_sources.py BUILD: the files that the compiler is given for the product in a build folder, a line
each: its sources, or those that stand for eight of them. Fails where a source of the product is in none."""
import json
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
ROOMS = ("can_dbc", "estimator", "daemon", "tools")

given, seen = [], set()
for each in json.loads((pathlib.Path(sys.argv[1]) / "compile_commands.json").read_text()):
    path = pathlib.Path(each["file"])
    # What tests compile anew of the product, headers compiled before all others, C.
    if re.search(r" -o (\S+/)?tests/", each["command"]) or path.suffix != ".cpp" and path.suffix != ".cxx" \
            or path.name in ("cmake_pch.hxx.cxx", "precompiled.cpp"):
        continue
    given.append(str(path))
    seen.add(str(path))
    if path.name.startswith("unity_"):
        seen.update(re.findall(r'^#include "(.*\.cpp)"$', path.read_text(), re.MULTILINE))
left = [str(path) for room in ROOMS for path in sorted((ROOT / room).rglob("*.cpp")) if str(path) not in seen]
if left:
    sys.exit(f"{sys.argv[1]}: compiles nothing of " + ", ".join(left))
print("\n".join(given))
