"""What a log of the bus says on which controllers, devices and host met, read with dbc.py alone."""

import collections

import dbc

LISTENING = 0x7FE  # of nobody: with it a test finds out whether candump listens


class Log:
    """faults: what no log may have. torques, answered, enabled, touching, peak_N: of `node`. busy_ticks, busy_bits, busy_frames: from
    the moment on when every node of `nodes` has had torque, so without the time in which programs come up."""

    def __init__(self, path, node=1, nodes=(1,)):
        messages = dbc.read("shared/wire.dbc")
        self.frames, self.busy_frames = collections.Counter(), collections.Counter()
        self.faults, self.torques = [], []
        self.peak_N, self.answerable, self.answered, self.enabled, self.touching, self.ticks = 0.0, 0, 0, 0, 0, 0
        self.busy_ticks = self.busy_bits = 0
        last, running = {}, set()
        for _, _, frame_id, data in dbc.log(path):
            if frame_id == LISTENING:
                continue
            try:
                name, values = dbc.decode(messages, frame_id, data)
            except dbc.Malformed as fault:
                self.faults.append(str(fault))
                continue
            self.frames[name] += 1
            if name == "Sync":
                self.ticks += 1
                self.follows(last, "SYNC", values["Counter"], 256)
            busy = running.issuperset(nodes)
            self.busy_ticks += busy and name == "Sync"
            if self.busy_ticks:
                self.busy_frames[name] += 1
                self.busy_bits += dbc.frame_bits(frame_id, data)
            if name == "Encoders":
                self.follows(last, "encoders of %d" % (frame_id - 0x180), values["Sequence"], 16)
            if name == "Torques":
                if not dbc.torque_crc_good(frame_id, data):
                    self.faults.append("a torque with a wrong CRC")
                if values["Enable"]:
                    running.add(frame_id - 0x200)
            if frame_id == 0x200 + node:
                self.torques.append(data)
                self.answerable += "encoders of %d" % node in last
                self.answered += last.get("encoders of %d" % node) == values["Sequence"]
                self.enabled += values["Enable"] == 1
            if frame_id == 0x380 + node and "ForceX" in values:
                self.peak_N = max(self.peak_N, sum(values["Force" + axis] ** 2 for axis in "XYZ") ** 0.5)
                self.touching += values["Contacts"] > 0

    def follows(self, last, what, number, modulus):
        if what in last and (number - last[what]) % modulus != 1:
            self.faults.append("%s: %d after %d" % (what, number, last[what]))
        last[what] = number

    def load(self, bit_rate=1e6):
        """Share of the bus at a tick per millisecond, from the bits of these very frames."""
        return self.busy_bits / (self.busy_ticks * 1e-3 * bit_rate) if self.busy_ticks else 0.0
