#!/usr/bin/python3
"""canmatrix_check.py BELTGRIP DBC: canmatrix reads DBC without a complaint and agrees with BELTGRIP.

A thousand random frames of each message, decoded by `beltgrip dbc decode --raw` and by canmatrix:
every raw value and every physical value must be the same.
"""
import json
import logging
import random
import subprocess
import sys

import canmatrix.formats


class Complaints(logging.Handler):
    def __init__(self):
        super().__init__(logging.WARNING)
        self.texts = []

    def emit(self, record):
        self.texts.append(record.getMessage())


def main(beltgrip, path):
    complaints = Complaints()
    # The import itself speaks of formats whose libraries are absent: that is not about our file.
    logging.getLogger().addHandler(complaints)
    matrix = canmatrix.formats.loadp_flat(path)
    errors = complaints.texts + [str(error) for error in matrix.load_errors]
    for frame in matrix.frames:
        used = {}
        for signal in frame.signals:
            start = signal.get_startbit(bit_numbering=1)
            for bit in range(start, start + signal.size):  # all ours are little endian
                if used.setdefault(bit, signal.name) != signal.name:
                    errors.append(f"{frame.name}: {signal.name} overlaps {used[bit]}")
                if bit >= 8 * frame.size:
                    errors.append(f"{frame.name}: {signal.name} lies outside the payload")
            if not signal.is_little_endian:
                errors.append(f"{frame.name}: {signal.name} is big endian: extend this check")

    random.seed(1)
    sent = []
    for frame in matrix.frames:
        sent += [(frame, random.randbytes(frame.size)) for _ in range(1000)]
    log = "".join(
        f"({i // 1000}.{i % 1000:06d}) vcan0 {frame.arbitration_id.id:03X}#{data.hex()}\n"
        for i, (frame, data) in enumerate(sent))
    command = [beltgrip, "dbc", "decode", "--dbc", path, "-", "--raw", "--json", "-"]
    run = subprocess.run(command, input=log, capture_output=True, text=True, check=True)
    lines = [json.loads(line) for line in run.stdout.splitlines()]
    if len(lines) != len(sent):
        errors.append(f"{len(lines)} of {len(sent)} frames decoded")
    for line, (frame, data) in zip(lines, sent):
        theirs = frame.decode(data)
        raw = {name: str(value.raw_value) for name, value in theirs.items()}
        physical = {name: float(value.phys_value) for name, value in theirs.items()}
        if line["message"] != frame.name or line["raw"] != raw:
            errors.append(f"{frame.name} {data.hex()}: raw {line['raw']}, canmatrix {raw}")
        # canmatrix calculates in decimals: equal but for the rounding of the two operations.
        for name, value in physical.items():
            if abs(line["signals"][name] - value) > 1e-15 * max(1.0, abs(value)):
                errors.append(f"{frame.name}.{name} {data.hex()}: {line['signals'][name]}, "
                              f"canmatrix {value}")
    for error in errors[:20]:
        print(error)
    print(f"{len(matrix.frames)} messages, {len(sent)} frames, {len(errors)} differences")
    return 1 if errors else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
