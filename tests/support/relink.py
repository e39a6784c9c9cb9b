"""A built test program once more, with one of its sources exchanged: what tests/mutate and
tests/defects have in common. The program's own objects and libraries stay as they are."""
import json
import math
import os
import pathlib
import shlex
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
WAITS = 50.0  # times its processor time: for a program that only waits


class Relink:
    def __init__(self, build, folder):
        self.build, self.folder = build, folder
        commands = json.loads((build / "compile_commands.json").read_text())
        self.commands = {each["file"]: shlex.split(each["command"]) for each in commands}

    def compile(self, name, copy, target, *options):
        """`copy` as the build compiles the source `name`, without its warnings. Its errors; '': done."""
        if str(ROOT / name) not in self.commands:
            sys.exit(f"{self.build}: {name} is compiled together with others; "
                     "configure with -DBELTGRIP_TOGETHER=nothing")
        line = self.commands[str(ROOT / name)][:]
        line[line.index("-o") + 1] = str(target)
        line[line.index("-c") + 1] = str(copy)
        done = subprocess.run([*line, f"-I{ROOT}", "-w", *options], capture_output=True,
                              text=True, cwd=self.build)
        return done.stderr if done.returncode else ""

    def room_of(self, test):
        """The program that build/tests/TEST is: that of its room, which goes by the name it has when
        it is called, or one of its own."""
        path = self.build / "tests" / test
        return os.readlink(path) if path.is_symlink() else test

    def link(self, test, out, objects):
        """What an object defines is not taken from the libraries behind it."""
        target = self.room_of(test)
        lines = subprocess.run(["ninja", "-C", self.build, "-t", "commands", target], check=True,
                               capture_output=True, text=True).stdout.splitlines()
        words = shlex.split(lines[-1])[2:-2]
        at = words.index("-o")
        words[at + 1] = str(out)
        subprocess.run([*words[:at], *map(str, objects), *words[at:]], check=True, cwd=self.build)

    def passes(self, program, limit_s, **environment):
        """Of processor time: how busy the machine is decides nothing."""
        limit = f"--cpu={math.ceil(limit_s)}"
        try:
            return subprocess.run(["prlimit", limit, program, "--gtest_fail_fast",
                                   "--gtest_brief=1"], cwd=self.build,
                                  env={**os.environ, **environment}, timeout=WAITS * limit_s,
                                  stdout=subprocess.DEVNULL,
                                  stderr=subprocess.DEVNULL).returncode == 0
        except subprocess.TimeoutExpired:
            return False
