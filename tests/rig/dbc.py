"""An independent reader of a DBC file, of candump's logs and of CAN's bits: none of the project's own code is used.

Only what shared/wire.dbc has: little-endian signals, one level of multiplexing, 11-bit identifiers.
"""

import re
import struct

NODES = 127


class Signal:
    def __init__(self, match):
        self.name, self.mux = match[1], match[2] or ""
        self.first, self.bits, self.signed = int(match[3]), int(match[4]), match[6] == "-"
        assert match[5] == "1", "big-endian signals are not read here"
        self.scale, self.offset = float(match[7]), float(match[8])
        self.low, self.high = float(match[9]), float(match[10])

    def raw(self, data):
        value = int.from_bytes(data, "little") >> self.first & (1 << self.bits) - 1
        return value - (1 << self.bits) if self.signed and value >> self.bits - 1 else value


class Message:
    def __init__(self, match):
        self.id, self.name, self.length, self.signals = int(match[1]), match[2], int(match[3]), []


def read(path):
    """Messages by identifier, those of node 1 also for the other nodes."""
    messages, last = {}, None
    for line in open(path, encoding="utf-8"):
        match = re.match(r"BO_ (\d+) (\w+): (\d+) ", line)
        if match:
            last = Message(match)
            messages[last.id] = last
        match = re.match(r" SG_ (\w+)( M| m\d+)? : (\d+)\|(\d+)@(\d)([+-]) \(([^,]+),([^)]+)\) \[([^|]+)\|([^]]+)\]", line)
        if match:
            last.signals.append(Signal(match))
    for message in list(messages.values()):
        if message.id & 0x7F == 1:
            for node in range(2, NODES):
                messages.setdefault(message.id + node - 1, message)
    return messages


class Malformed(Exception):
    pass


def decode(messages, frame_id, data):
    """Name and physical values; Malformed for what the DBC does not have."""
    message = messages.get(frame_id)
    if message is None:
        raise Malformed("identifier %03X" % frame_id)
    if len(data) != message.length:
        raise Malformed("%s with %d bytes" % (message.name, len(data)))
    page = next((s.raw(data) for s in message.signals if s.mux.strip() == "M"), None)
    pages = {int(s.mux.strip()[1:]) for s in message.signals if s.mux.strip()[:1] == "m"}
    if page is not None and page not in pages:
        raise Malformed("%s page %d" % (message.name, page))
    values = {}
    for s in message.signals:
        if s.mux.strip()[:1] == "m" and int(s.mux.strip()[1:]) != page:
            continue
        value = s.raw(data) * s.scale + s.offset
        if not s.low - 1e-6 * abs(s.low) <= value <= s.high + 1e-6 * abs(s.high):
            raise Malformed("%s.%s = %g" % (message.name, s.name, value))
        values[s.name] = value
    return message.name, values


def log(path):
    """(seconds, interface, identifier, bytes) of each line of `candump -L` with 11-bit data frames."""
    for line in open(path):
        match = re.match(r"\((\d+\.\d+)\) (\S+) ([0-9A-F]{3})#((?:[0-9A-F]{2})*)(?: [TR])?$", line)
        if not match:
            raise Malformed("line %r" % line)
        yield float(match[1]), match[2], int(match[3], 16), bytes.fromhex(match[4])


def crc8_autosar(data):
    crc = 0xFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc << 1 & 0xFF ^ (0x2F if crc & 0x80 else 0)
    return crc ^ 0xFF


def torque_crc_good(frame_id, data):
    return crc8_autosar(struct.pack("<H", frame_id) + data[:7]) == data[7]


def frame_bits(frame_id, data):
    """Bits of a classic frame on the bus, stuff bits and intermission included (ISO 11898-1)."""
    def number(value, count):
        return [value >> i & 1 for i in reversed(range(count))]

    bits = [0] + number(frame_id, 11) + [0, 0, 0] + number(len(data), 4)
    for byte in data:
        bits += number(byte, 8)
    crc = 0
    for bit in bits:
        crc = (crc << 1 & 0x7FFF) ^ (0x4599 if bit ^ crc >> 14 else 0)
    bits += number(crc, 15)
    stuffed, run, last = 0, 0, None
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            stuffed += 1
            last, run = 1 - bit, 1
    return len(bits) + stuffed + 1 + 2 + 7 + 3
