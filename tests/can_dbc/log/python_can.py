#!/usr/bin/python3
"""python_can.py read FILE | write FILE: a log by another program, python-can.

Prints "seconds channel frame" a frame, the frame as candump writes it; "error" for error frames.
write: 5000 frames of every kind that python-can writes, the same every time.
"""
import random
import sys

import can

START_S = 1700000000.25
FD_LENGTHS = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64]


def text(message):
    if message.is_error_frame:
        frame = "error"
    else:
        frame = f"{message.arbitration_id:0{8 if message.is_extended_id else 3}X}#"
        if message.is_remote_frame:
            frame += "R" + (f"{message.dlc:X}" if message.dlc else "")
        elif message.is_fd:
            flags = int(message.bitrate_switch) + 2 * int(message.error_state_indicator)
            frame += f"#{flags}" + bytes(message.data).hex().upper()
        else:
            frame += bytes(message.data).hex().upper()
    return f"{message.timestamp:.6f} {message.channel + 1} {frame}{'' if message.is_rx else ' T'}"


def random_message(draw, time_s):
    extended = draw.random() < 0.5
    kind = draw.choice(["data", "data", "remote", "fd", "error"])
    length = draw.choice(FD_LENGTHS) if kind == "fd" else draw.randrange(9)
    return can.Message(
        timestamp=time_s, channel=draw.randrange(4), is_extended_id=extended,
        arbitration_id=draw.randrange(1 << (29 if extended else 11)),
        is_remote_frame=kind == "remote", is_error_frame=kind == "error", is_fd=kind == "fd",
        bitrate_switch=kind == "fd" and draw.random() < 0.5,
        error_state_indicator=kind == "fd" and draw.random() < 0.5,
        is_rx=kind == "error" or draw.random() < 0.8, dlc=length,
        data=None if kind in ("remote", "error") else draw.randbytes(length))


def write(path):
    draw = random.Random(1)
    time_s = START_S
    with can.BLFWriter(path) as log:
        for _ in range(5000):
            log.on_message_received(random_message(draw, time_s))
            time_s += draw.choice([0.0, 0.0001, 0.25])


if sys.argv[1] == "write":
    write(sys.argv[2])
for found in can.BLFReader(sys.argv[2]):
    print(text(found))
