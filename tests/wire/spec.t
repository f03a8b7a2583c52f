#!/usr/bin/env python3
"""shared/SPEC.md, section Wire, says what shared/wire.dbc says: every table, every bit of every frame taken apart.

Reads both files by its own means; the program's parser and packing are not used.
"""
# not sanitised: runs no program

import re
import sys

SIGNAL = re.compile(r' SG_ (\w+) (?:(M)|m(\d+))? ?: (\d+)\|(\d+)@1([+-]) \(([^,]+),([^)]+)\) \[[^]]*\] "([^"]*)"')


class Signal:
    def __init__(self, match):
        self.name, selector, page, start, bits, sign, factor, offset, self.unit = match.groups()
        self.selector, self.page = bool(selector), None if page is None else int(page)
        self.start, self.bits, self.signed = int(start), int(bits), sign == "-"
        self.factor = float(factor)
        assert float(offset) == 0

    def raw(self, data):
        """Bit by bit, as the DBC language defines it."""
        value = 0
        for k in range(self.bits):
            at = self.start + k
            if data[at // 8] >> at % 8 & 1:
                value += -(1 << k) if self.signed and k == self.bits - 1 else 1 << k
        return value

    def row(self, paged):
        """The cells of the table before the meaning."""
        last = self.start + self.bits - 1
        bits = str(self.start) if self.bits == 1 else "%d..%d" % (self.start, last)
        if abs(self.factor * 65535 - 1) < 1e-12:
            step = "1/65535"
        elif self.factor == 1:
            step = "1" if self.unit else ""
        else:
            step = ("%.10f" % self.factor).rstrip("0")
        cells = [bits, self.name, "%s%d" % ("i" if self.signed else "u", self.bits), (step + " " + self.unit).strip()]
        return cells + (["" if self.page is None else str(self.page)] if paged else [])


class Message:
    def __init__(self, match):
        self.id, self.name, self.length, self.sender = int(match[1]), match[2], int(match[3]), match[4]
        self.signals = []

    def paged(self):
        return any(signal.selector for signal in self.signals)

    def present(self, data):
        page = next((signal.raw(data) for signal in self.signals if signal.selector), None)
        return [signal for signal in self.signals if signal.page is None or signal.page == page]

    def identifier(self):
        return "0x%03X + node" % (self.id - 1) if self.id & 127 == 1 else "0x%03X" % self.id


def read_dbc(path):
    messages = []
    for line in open(path, encoding="utf-8"):
        head = re.match(r"BO_ (\d+) (\w+): (\d+) (\w+)", line)
        if head:
            messages.append(Message(head))
        elif line.startswith(" SG_"):
            messages[-1].signals.append(Signal(SIGNAL.match(line)))
    return messages


def cells(line):
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def check_table(message, text):
    rows = [cells(line) for line in text.split("\n") if re.match(r"\| \d", line)]
    width = 5 if message.paged() else 4
    expected = [signal.row(message.paged()) for signal in message.signals]
    for row, right in zip([row[:width] for row in rows], expected):
        if row != right:
            yield "the row is %s, by the DBC %s" % (row, right)
    if len(rows) != len(expected):
        yield "%d rows, %d signals" % (len(rows), len(expected))
    sender = re.search(r"^(\w+), (\d) bytes?, ", text, re.MULTILINE)
    if not sender or (sender[1], int(sender[2])) != (message.sender, message.length):
        yield "sender or length are not %s, %d" % (message.sender, message.length)


def crc8_autosar(data):
    """By long division of the message as one number, unlike shared/crc.c."""
    bits = int.from_bytes(data, "big") ^ 0xFF << 8 * (len(data) - 1)
    bits <<= 8
    for at in range(8 * len(data) + 7, 7, -1):
        if bits >> at & 1:
            bits ^= 0x12F << at - 8
    return bits ^ 0xFF


def check_frame(message, block):
    lines = [line.strip() for line in block.strip().split("\n")]
    head = re.fullmatch(r"([0-9A-F]{3})#((?:[0-9A-F]{2})*)", lines[0])
    if not head:
        yield "%r is not a frame" % lines[0]
        return
    data = bytes.fromhex(head[2])
    if int(head[1], 16) != message.id or len(data) != message.length:
        yield "%s is not an identifier or length of %s" % (lines[0], message.name)
        return
    present = message.present(data)
    if message.paged() and not any(signal.page is not None for signal in present):
        yield "%s has a page that does not exist" % lines[0]
    expected = []
    for i, byte in enumerate(data):
        owners = []
        for signal in sorted(present, key=lambda signal: -signal.start):
            low, high = max(signal.start, 8 * i), min(signal.start + signal.bits, 8 * i + 8) - 1
            if low <= high:
                span = "%d" if low == high else "%d:%d"
                ends = (high - signal.start, low - signal.start)
                owners.append(signal.name + " " + span % (ends[:1] if low == high else ends))
        expected.append("byte %d  %02X  %s  %s" % (i, byte, format(byte, "08b"), ", ".join(owners) or "-"))
    for signal in present:
        raw = signal.raw(data)
        line = "%s = %d" % (signal.name, raw)
        if signal.factor != 1:
            line += " = %.6g" % (raw * signal.factor)
        expected.append((line + " " + signal.unit).strip())
    for line, right in zip(lines[1:], expected):
        if line != right:
            yield "%s: %r should be %r" % (lines[0], line, right)
    if len(lines) - 1 != len(expected):
        yield "%s: %d lines, not %d" % (lines[0], len(lines) - 1, len(expected))
    owned = sum(((1 << signal.bits) - 1) << signal.start for signal in present)
    if int.from_bytes(data, "little") & ~owned:
        yield "%s: a bit that nobody owns is not 0" % lines[0]
    identifier = int(lines[0].split("#")[0], 16)
    torque_bytes = identifier.to_bytes(2, "little") + bytes(data[:7])
    if message.name == "Torques" and crc8_autosar(torque_bytes) != data[7]:
        yield "%s: the CRC is 0x%02X" % (lines[0], crc8_autosar(torque_bytes))


def check_timing(wire):
    """Each row's bits are 55 + 10 n, and the ends add up with 300 us to compute."""
    end = 0
    rows = [cells(line) for line in re.search(r"### One tick\n(.*?)\n### ", wire, re.DOTALL)[1].split("\n")
            if line.startswith("| ") and not line.startswith("| step")]
    for step, frame, bits, by in rows:
        count = 2 if frame.startswith("two frames") else 1
        length = re.search(r"(\d) bytes?", frame)
        wait = re.search(r"at most (\d+) µs", step)
        duration = count * (55 + 10 * int(length[1])) if length else 0
        end += duration + (int(wait[1]) if wait else 0)
        if bits and int(bits) != duration:
            yield "%s: %s bits, not %d" % (frame, bits, duration)
        if by != "%d µs" % end:
            yield "%s ends by %s, not %d µs" % (step, by, end)
    if len(rows) != 5 or end > 1000:
        yield "%d rows, the tick ends at %d µs" % (len(rows), end)


def check_load(wire, messages):
    """Each row is the DBC's length and firmware/telemetry.c's pace; the sum is what the last row says."""
    length = {message.name: message.length for message in messages}
    paces = [{key: int(value) for key, value in re.findall(r"\.(\w+) = (\d+)", row)} for row in re.findall(
        r"\{(\.contact = .*?)\}", open("firmware/telemetry.c", encoding="utf-8").read())]
    paced = {"Contact": "contact", "ForcePose": "pose", "Health": "health", "Heartbeat": "heartbeat"}
    table = re.search(r"### Bus load\n(.*?)\n### ", wire, re.DOTALL)
    rows = [cells(line) for line in table[1].split("\n") if line.startswith("| ")][1:] if table else []
    total = [0, 0]
    for frame, bits, *turns in rows[:-1]:
        name = frame.split(",")[0]
        frames = 2 if "pair" in frame else 1
        if int(bits) != frames * (55 + 10 * length[name]):
            yield "%s: %s bits" % (frame, bits)
        for column, turn in enumerate(turns):
            every = int(turn.split()[0])
            senders = 2 if column and "," not in turn else 1
            total[column] += senders * int(bits) / (1000 * every)
            if name in paced and every != paces[column][paced[name]]:
                yield "%s: %s, but %d in telemetry.c" % (name, turn, paces[column][paced[name]])
    if not rows or rows[-1][2:] != ["%.1f %%" % (100 * share) for share in total]:
        yield "the sums are %s" % total
    if total[1] > 0.7 or total[1] == 0:
        yield "two instruments take %g of the bus" % total[1]


def main():
    messages = read_dbc("shared/wire.dbc")
    text = open("shared/SPEC.md", encoding="utf-8").read()
    wire = re.search(r"^## Wire\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    wire = wire[1] if wire else ""
    sections = dict(re.findall(r"^#### (\w+): [^\n]*\n(.*?)(?=^#|\Z)", wire, re.MULTILINE | re.DOTALL))
    headings = dict(re.findall(r"^#### (\w+): ([^\n]*)$", wire, re.MULTILINE))
    listed = [cells(line)[:3] for line in wire.split("\n") if line.startswith("| 0x")]
    results = [("every frame has a section, and only those", sorted(
        set(sections) ^ {message.name for message in messages}))]
    results.append(("the list of identifiers is the DBC's", [str(pair) for pair in zip(
        listed, [[message.identifier(), message.name, message.sender.lower()] for message in messages])
        if pair[0] != pair[1]] + (["%d rows" % len(listed)] if len(listed) != len(messages) else [])))
    results.append(("the times of a tick add up", list(check_timing(wire)) if sections else ["no section"]))
    results.append(("the load of one and two instruments adds up, and is below 70 %", list(check_load(wire, messages))))
    for message in messages:
        section = sections.get(message.name, "")
        faults = list(check_table(message, section))
        if headings.get(message.name) != message.identifier():
            faults.append("the heading's identifier is not %s" % message.identifier())
        results.append(("table of %s" % message.name, faults))
        blocks = re.findall(r"^```\n(.*?)^```", section, re.MULTILINE | re.DOTALL)
        results.append(("frames of %s, byte by byte" % message.name,
                        [fault for block in blocks for fault in check_frame(message, block)] +
                        ([] if blocks else ["there is none"])))
    print("1..%d" % len(results))
    for number, (what, faults) in enumerate(results, 1):
        print("%s %d - %s" % ("not ok" if faults else "ok", number, what))
        for fault in faults:
            print("# " + fault)
    return 1 if any(faults for _, faults in results) else 0


sys.exit(main())
