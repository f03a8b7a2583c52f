#!/usr/bin/env python3
"""jitter.py [SECONDS]: how late this machine begins the controller's ticks, and how late it begins nothing at all.

Three programs on a bus of pseudo-terminals (slcan_hub.py), the controller in real time with a millisecond a tick; then the same
machine with a thread that only sleeps for every millisecond, as cyclictest has it: its limits, beside which the first is to be
read. Not a gate: the figures are those of this machine and of what else it does.
"""

import os
import pathlib
import signal
import subprocess
import sys
import tempfile

B = os.environ.get("B", "build")
TROCAR, CONTROLLER, PROBE = B + "/trocar", B + "/firmware/native/controller.elf", B + "/tests/rig/socketcan_probe"
seconds = sys.argv[1] if len(sys.argv) > 1 else "60"

with tempfile.TemporaryDirectory() as name:
    place = pathlib.Path(name)
    subprocess.run([PROBE, "bank", place / "bank"], check=True)
    hub = subprocess.Popen([sys.executable, "tests/rig/slcan_hub.py", place, "3"])
    while not (place / "ready").exists():
        os.sched_yield()
    bus = ["slcan:%s/%d" % (place, i) for i in range(3)]
    device = subprocess.Popen([TROCAR, "device", place / "bank", "--bus", bus[1], "--gesture", "tour", "--repeat"],
                              stderr=subprocess.DEVNULL)
    host = subprocess.Popen([TROCAR, "run", "--bus", bus[2]], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    print("loop, %s s, load %.1f" % (seconds, os.getloadavg()[0]), flush=True)
    subprocess.run([CONTROLLER, place / "bank", "--bus", bus[0], "--ticks", str(1000 * int(seconds))], stderr=sys.stdout)
    for process in (host, device, hub):
        process.send_signal(signal.SIGINT)
        process.wait()
print("\nbare, %s s, load %.1f" % (seconds, os.getloadavg()[0]), flush=True)
subprocess.run([CONTROLLER, "--bare", seconds])
