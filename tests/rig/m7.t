#!/usr/bin/env python3
# not sanitised: it runs the controller's images, which are built once
"""The controller on an emulated Cortex-M7 gives the frames that it gives on this machine, byte for byte.

A tour over the demo's organ with contact lost and regained, 2 % of the encoder frames dropped, is recorded from a
simulated run and answered by the simulation's controller, by the native port and by the emulated board. TROCAR_LONG=1:
60 thousand ticks.
"""

import csv
import os
import pathlib
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import m7

PORT = pathlib.Path("firmware/ports/cortex_m7_an500")
LONG_TICKS = 60000
FAULTS = [("c", "writing to code"), ("b", "writing to the bank"), ("x", "executing in RAM"),
          ("s", "a stack that overflows"), ("p", "a peripheral that is not the port's")]
STACK_MOST = 4096
PLAN = 8 + len(FAULTS)
count = 0
failed = False


def result(good, claim, note=""):
    global count, failed
    count += 1
    failed = failed or not good
    print("%sok %d - %s" % ("" if good else "not ", count, claim))
    if not good and note:
        print("".join("# %s\n" % line for line in str(note).splitlines()), end="")
    sys.stdout.flush()


def replay(place):
    bank, answers, ticks, log = (place / name for name in ("demo.bank", "answers", "ticks.csv", "torques"))
    m7.build_bank(bank, "host/scenes/demo/demo.yaml")
    gesture, options = "tour", ["--drop", 0.02, "--torques", log]
    if os.environ.get("TROCAR_LONG"):
        gesture = place / "long.gesture"
        text = subprocess.run([m7.TROCAR, "run", "--print-gesture", "tour"], check=True, capture_output=True, text=True)
        gesture.write_text(text.stdout + "repeat 100\n")
        options += ["--ticks", LONG_TICKS]
    m7.record(bank, gesture, answers, ticks, *options)
    rows = list(csv.DictReader(ticks.open()))
    touching = [int(row["contacts"]) > 0 for row in rows]
    losses = sum(a and not b for a, b in zip(touching, touching[1:]))
    lost = len(rows) - len(m7.frames(answers, 0x181))
    result(losses >= 3 and lost > len(rows) // 100 and sum(touching) > 1000,
           "the recording has contact, contact lost and samples lost",
           "%d ticks, %d in contact, lost %d times; %d samples lost" % (len(rows), sum(touching), losses, lost))

    here, there, again = (place / name for name in ("native", "m7", "m7.again"))
    process = m7.native(bank, answers, here)
    # The session ends at its last tick; the port goes on until it finds the input's end, half a tick later.
    result(process.returncode == 0 and m7.frames(here, m7.TORQUES)[:len(rows)] == m7.logged(log, m7.TORQUES),
           "the native port answers the recording with the torques of the run", process.stderr)
    begin = time.monotonic()
    process = m7.emulate([answers, there], bank)
    seconds = time.monotonic() - begin
    print("# %d ticks, %d of them in contact, at %d ticks/s; %s" % (len(rows), sum(touching), len(rows) / seconds,
                                                                  process.stderr.strip()))
    result(process.returncode == 0, "the emulated Cortex-M7 runs the recording to its end", process.stderr)
    torques = m7.frames(there, m7.TORQUES)
    result(len(torques) >= len(rows) and torques == m7.frames(here, m7.TORQUES), "its torque frames are the native port's")
    result(there.read_bytes() == here.read_bytes(), "and so are all frames, and the times at which it waits")
    stack = int(process.stderr.split("stack ")[1].split()[0])
    result(0 < stack <= STACK_MOST, "the stack that was ever in use is at most %d bytes" % STACK_MOST, stack)
    m7.emulate([answers, again], bank)
    result(again.read_bytes() == there.read_bytes(), "a second run gives the same")

    damaged = bytearray(bank.read_bytes())
    damaged[len(damaged) // 2] ^= 16
    (place / "damaged.bank").write_bytes(damaged)
    process = m7.emulate([answers, there], place / "damaged.bank")
    expected = m7.native(place / "damaged.bank", answers, here)
    emergencies = m7.frames(there, m7.EMERGENCY)
    result(process.returncode == expected.returncode == 6 and len(emergencies) == 1
           and emergencies[0][:2] == b"\x00\x63" and there.read_bytes() == here.read_bytes(),
           "a damaged bank is refused with the same emergency frame", process.stderr)


def faults(place):
    """The port's start-up code under a program that does what it must not."""
    image = place / "faults.elf"
    objects = m7.BUILD / "firmware/cortex_m7_an500" / PORT
    subprocess.run(["arm-none-eabi-gcc", "-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-sp-d16", "-std=c11",
                    "-O1", "-Wall", "-Werror", "-ffreestanding", "-nostdlib", "-static", "-T", PORT / "an500.ld", "-I", PORT,
                    "tests/rig/an500_faults.c", *(objects / name for name in ("start.o", "semihosting.o", "memory.o")),
                    "-o", image], check=True)
    allowed = m7.emulate(["none"], image=image)
    for letter, what in FAULTS:
        process = m7.emulate([letter], image=image)
        result(allowed.returncode == 0 and process.returncode == 10 and process.stderr.startswith("controller: fault ")
               and "cfsr=0000" in process.stderr, "%s is a fault that is reported" % what,
               "%d %s; without it: %d %s" % (process.returncode, process.stderr, allowed.returncode, allowed.stderr))
        print("# " + process.stderr.strip())


def main():
    why = m7.missing()
    if why:
        print("1..0 # SKIP " + why)
        return 0
    print("1..%d" % PLAN)
    with tempfile.TemporaryDirectory(prefix="trocar-m7-") as place:
        replay(pathlib.Path(place))
        faults(pathlib.Path(place))
    return 1 if failed else 0


sys.exit(main())
