"""What must hold of a log of the bus on which device, controller and host met, judged with dbc.py alone."""

import collections

import dbc

SAFE_RUN = (2, 3)


class Log:
    def __init__(self, path, node=1):
        messages = dbc.read("shared/wire.dbc")
        self.frames = collections.Counter()
        self.faults, self.torques, self.bits, self.seconds = [], [], 0, 0.0
        self.peak_N, self.answered, self.enabled, self.touching, self.ticks = 0.0, 0, 0, 0, 0
        sync = encoders = None
        for seconds, _, frame_id, data in dbc.log(path):
            try:
                name, values = dbc.decode(messages, frame_id, data)
            except dbc.Malformed as fault:
                self.faults.append(str(fault))
                continue
            self.frames[name] += 1
            self.bits += dbc.frame_bits(frame_id, data)
            if name == "Sync":
                if sync is not None and (values["Counter"] - sync) % 256 != 1:
                    self.faults.append("SYNC %d after %d" % (values["Counter"], sync))
                sync = values["Counter"]
                self.ticks += 1
            if frame_id == 0x180 + node:
                if encoders is not None and (values["Sequence"] - encoders) % 16 != 1:
                    self.faults.append("encoders %d after %d" % (values["Sequence"], encoders))
                encoders = values["Sequence"]
            if frame_id == 0x200 + node:
                self.torques.append(data)
                if not dbc.torque_crc_good(frame_id, data):
                    self.faults.append("a torque with a wrong CRC")
                self.answered += encoders is not None and values["Sequence"] == encoders
                self.enabled += values["Enable"] == 1
            if frame_id == 0x380 + node and "ForceX" in values:
                self.peak_N = max(self.peak_N, sum(values["Force" + axis] ** 2 for axis in "XYZ") ** 0.5)
                self.touching += values["Contacts"] > 0

    def load(self, bit_rate=1e6):
        """Share of the bus at one tick per millisecond, from the bits of these very frames."""
        return self.bits / (self.ticks * 1e-3 * bit_rate) if self.ticks else 0.0
