#!/usr/bin/python3
"""mdf_reader.py frames FILE | signals FILE: an MDF 4 file, read without any code of BeltGrip.

Written from the format's description, for tests alone: whole files in memory, errors are exceptions.
frames: "nanoseconds channel frame", the frame as candump writes it, in the order of time.
signals: a line a channel: name, unit, number of samples; then its times and values.
"""
import struct
import sys
import zlib

FD_LENGTHS = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64]


class Block:
    def __init__(self, data, at):
        self.at = at
        self.id, self.length, count = struct.unpack_from("<4s4xQQ", data, at)
        assert self.id[:2] == b"##", f"no block at {at}"
        self.links = struct.unpack_from(f"<{count}Q", data, at + 24)
        self.body_at = at + 24 + 8 * count
        self.body = data[self.body_at:at + self.length]


class Mdf:
    def __init__(self, path):
        with open(path, "rb") as file:
            self.data = file.read()
        self.finished = self.data[:8] == b"MDF     "
        assert self.finished or self.data[:8] == b"UnFinMF "
        self.version = struct.unpack_from("<H", self.data, 28)[0]
        self.header = self.block(64)
        assert self.header.id == b"##HD"
        self.start_ns = struct.unpack_from("<Q", self.header.body)[0]

    def block(self, at):
        return Block(self.data, at)

    def chain(self, at):
        while at:
            block = self.block(at)
            yield block
            at = block.links[0]

    def text(self, at):
        return self.block(at).body.split(b"\0")[0].decode() if at else ""

    def content(self, at):
        """All bytes behind a link to data."""
        if not at:
            return b""
        block = self.block(at)
        if block.id in (b"##DT", b"##SD", b"##DV"):
            return self.data[block.body_at:] if not self.finished and block.length == 24 else block.body
        if block.id == b"##DZ":
            kind, columns, size, packed = struct.unpack_from("<2xBxIQQ", block.body)
            raw = zlib.decompress(block.body[24:24 + packed])
            assert len(raw) == size
            if kind == 1:
                rows = size // columns
                turned = bytearray(raw)
                for row in range(rows):
                    turned[row * columns:(row + 1) * columns] = raw[row:rows * columns:rows]
                raw = bytes(turned)
            return raw
        if block.id == b"##HL":
            return self.content(block.links[0])
        assert block.id == b"##DL", block.id
        return b"".join(self.content(link) for lists in self.chain(at) for link in lists.links[1:])

    def channels(self, at):
        for block in self.chain(at):
            yield Channel(self, block)
            if block.links[1] and self.block(block.links[1]).id == b"##CN":
                yield from self.channels(block.links[1])

    def groups(self):
        """Of each channel group: itself, its records, its bytes of variable length by group."""
        for data_group in self.chain(self.header.links[0]):
            id_size = data_group.body[0]
            groups = [ChannelGroup(self, block) for block in self.chain(data_group.links[1])]
            by_id = {group.id: group for group in groups}
            content = self.content(data_group.links[2])
            at = 0
            while at < len(content):
                group = by_id[int.from_bytes(content[at:at + id_size], "little")] if id_size else groups[0]
                at += id_size
                if group.variable:
                    size = 4 + struct.unpack_from("<I", content, at)[0]
                    group.stream += content[at:at + size]
                else:
                    size = group.size
                    group.records.append(content[at:at + size])
                at += size
            yield from (group for group in groups if not group.variable)


class ChannelGroup:
    def __init__(self, mdf, block):
        self.id, self.cycles, self.flags, size, invalid = struct.unpack_from("<QQH6xII", block.body)
        self.at = block.at
        self.variable = bool(self.flags & 1)
        self.size = size + invalid
        self.name = mdf.text(block.links[2])
        self.channels = list(mdf.channels(block.links[1])) if not self.variable else []
        self.records = []
        self.stream = bytearray()
        mdf.by_place = getattr(mdf, "by_place", {})
        mdf.by_place[block.at] = self


class Channel:
    def __init__(self, mdf, block):
        (self.type, self.sync, self.data_type, self.bit, self.byte, self.bits,
         self.flags) = struct.unpack_from("<BBBBIII", block.body)
        self.name = mdf.text(block.links[2])
        self.unit = mdf.text(block.links[6])
        self.link = block.links[5]
        self.mdf = mdf
        self.table, self.linear = {}, (0.0, 1.0)
        if block.links[4]:
            body = mdf.block(block.links[4]).body
            kind, count = struct.unpack_from("<B5xH", body)
            values = struct.unpack_from(f"<{count}d", body, 24)
            if kind == 1:
                self.linear = values
            elif kind == 5:
                self.table = dict(zip(values[::2], values[1::2]))
            else:
                assert kind == 0, kind

    def raw(self, record):
        size = (self.bit + self.bits + 7) // 8
        piece = record[self.byte:self.byte + size]
        if self.data_type in (4, 5):
            return struct.unpack(("<" if self.data_type == 4 else ">") + {4: "f", 8: "d"}[size], piece)[0]
        order = "big" if self.data_type in (1, 3) else "little"
        return int.from_bytes(piece, order) >> self.bit & (1 << self.bits) - 1

    def value(self, record):
        if self.type in (3, 6):
            return self.linear[0]
        raw = self.raw(record)
        return self.table.get(raw, raw) if self.table else self.linear[0] + self.linear[1] * raw

    def bytes(self, record):
        if self.type != 1:
            return record[self.byte:self.byte + self.bits // 8]
        at = self.raw(record)
        if self.link in self.mdf.by_place:
            stream = self.mdf.by_place[self.link].stream
        else:
            stream = self.mdf.content(self.link)
        size = struct.unpack_from("<I", stream, at)[0]
        return bytes(stream[at + 4:at + 4 + size])


def frame_text(kind, channels, record):
    def number(name, default=0):
        return int(channels[name].value(record)) if name in channels else default

    if kind == "CAN_ErrorFrame":
        return "20000080#" + "00" * 8
    ident = number("ID")
    text = f"{ident:0{8 if number('IDE') else 3}X}#"
    if kind == "CAN_RemoteFrame":
        return text + "R" + (f"{number('DLC'):X}" if number("DLC") else "")
    length = number("DataLength") if "DataLength" in channels else FD_LENGTHS[number("DLC")]
    payload = channels["DataBytes"].bytes(record)[:length].hex().upper()
    if number("EDL"):
        text += f"#{number('BRS') + 2 * number('ESI')}"
    return text + payload


def frames(mdf):
    found = []
    for group in mdf.groups():
        kinds = {channel.name.split(".")[0] for channel in group.channels}
        kinds &= {"CAN_DataFrame", "CAN_RemoteFrame", "CAN_ErrorFrame"}
        if not kinds:
            continue
        kind = kinds.pop()
        channels = {c.name.split(".")[1]: c for c in group.channels if c.name.startswith(kind + ".")}
        time = next(c for c in group.channels if c.type == 2)
        factor_ns = round(time.linear[1] * 1e9)
        for record in group.records:
            t_ns = mdf.start_ns + round(time.linear[0] * 1e9) + round(time.raw(record) * factor_ns)
            bus = int(channels["BusChannel"].value(record)) if "BusChannel" in channels else 1
            found.append((t_ns, bus, frame_text(kind, channels, record)))
    for t_ns, bus, text in sorted(found, key=lambda frame: frame[0]):
        print(f"{t_ns} {bus} {text}")


def signals(mdf):
    print(f"version {mdf.version} start {mdf.start_ns} finished {int(mdf.finished)}")
    for group in mdf.groups():
        assert group.cycles == len(group.records), "number of records"
        time = next(c for c in group.channels if c.type == 2 and c.sync == 1)
        for channel in group.channels:
            if channel is time:
                continue
            print(f"{channel.name}\t{channel.unit}\t{len(group.records)}")
            for record in group.records:
                print(f"{time.value(record)!r}\t{channel.value(record)!r}")


if __name__ == "__main__":
    {"frames": frames, "signals": signals}[sys.argv[1]](Mdf(sys.argv[2]))
