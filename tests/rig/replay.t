#!/usr/bin/env python3
# not sanitised: it runs the controller's images, which are built once
"""The controller on an emulated processor gives the frames that it gives on this machine, byte for byte.

A gesture over the demo's organ with presses, slides there and back, pokes and contact lost and regained, 2 % of the encoder
frames dropped, is recorded from a simulated run, then answered by the simulation's controller, by the native port and by each
emulated board. The Cortex-R5F gets and sends its frames by its CAN controller. TROCAR_LONG=1: 60 thousand ticks.
The same, shorter, for images with every effect, on a scene that names them.
"""

import csv
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import emulated

LONG = bool(os.environ.get("TROCAR_LONG"))
LONG_TICKS = 60000
FAULTS = [("c", "writing to code"), ("b", "writing to the bank"), ("x", "executing in RAM"),
          ("s", "a stack that overflows"), ("p", "a peripheral that is not the port's")]
REPORTS = {  # what a fault's report must say
    "cortex_m7_an500": {letter: "cfsr=0000" for letter, _ in FAULTS} | {"s": "stack=overflow"},
    "cortex_r5_zcu102": {"c": "data abort pc=", "b": "data abort pc=.*dfar=10000000", "x": "prefetch abort pc=.*ifar=00400000",
                         "s": "data abort stack=overflow", "p": "data abort pc=.*dfar=40004000"},
}
# Scenes with effects, as few as hold all. A new one joins here.
EFFECTS = {"friction": "effects: {friction: {mu: 0.3}}", "swing": "effects: {swing: {modes: 4}}",
           "viscoelastic": "effects: {viscoelastic: {prony: [[0.5, 0.05 s], [1, 0.5 s]]}}",
           "neo_hookean": "effects: {neo_hookean: {sites: 60}}",
           "quasi_nonlinear": "effects: {quasi_nonlinear: {Q: {range: 2 N, coefficients: [2, 0.5, 1]}}}",
           "grasp": "effects: {grasp: {closes: 60 %, opens: 40 %, slip: 2 N, sweeps: 10}}",
           "shape": "effects: {shape: {shaft: {samples: 3}, jaws: {samples: 2}}}",
           "rigid": "effects: {rigid: {obstacles: [{name: rib, hull: [[-0.019, -0.12, 0.12], [-0.019, -0.04, 0.14]], radius: 4 mm}]}}",
           "second": "effects: {}"}
EFFECTS_GESTURE = ("approach 0.3 s\npress 15 mm in 0.4 s\nclose 0.1 s\nslide 15 mm 10 mm in 0.4 s\nopen 0.1 s\n"
                   "slide -25 mm 0 mm in 0.5 s\npoke 10 mm in 0.2 s\n")
STACK_MOST = 4096
LIVE_TICKS = 1000
CHECKS = 8 + 3 * len(EFFECTS) + len(FAULTS)  # of each port
count = 0
failed = False


def result(good, claim, note="", skip=None):
    global count, failed
    count += 1
    failed = failed or not (good or skip)
    print("%sok %d - %s%s" % ("" if good or skip else "not ", count, claim, " # SKIP " + skip if skip else ""))
    if not good and note:
        print("".join("# %s\n" % line for line in str(note).splitlines()), end="")
    sys.stdout.flush()


class Recording:
    """A simulated run: the bank, what the controller hears, and the torques of the run."""

    def __init__(self, place, scene, gesture, options):
        self.place = place
        self.bank, self.answers, self.log, self.here = (
            place / (name + scene.stem) for name in ("bank.", "answers.", "torques.", "native."))
        ticks = place / "ticks.csv"
        emulated.build_bank(self.bank, scene)
        emulated.record(self.bank, gesture, self.answers, ticks, "--drop", 0.02, "--torques", self.log, *options)
        self.rows = list(csv.DictReader(ticks.open()))


class DemoRecording(Recording):
    def __init__(self, place):
        gesture, options = "tour", []
        if LONG:
            gesture = place / "long.gesture"
            text = subprocess.run([emulated.TROCAR, "run", "--print-gesture", "tour"], check=True, capture_output=True, text=True)
            gesture.write_text(text.stdout + "repeat 100\n")
            options += ["--ticks", LONG_TICKS]
        super().__init__(place, pathlib.Path("host/scenes/demo/demo.yaml"), gesture, options)
        self.touching = [int(row["contacts"]) > 0 for row in self.rows]
        self.damaged = place / "damaged.bank"
        damaged = bytearray(self.bank.read_bytes())
        damaged[len(damaged) // 2] ^= 16
        self.damaged.write_bytes(damaged)


class EffectsRecording(Recording):
    def __init__(self, place, name):
        self.name = name
        scene = place / (name + ".yaml")
        shutil.copy("host/scenes/demo/liver.geo", place)
        text = pathlib.Path("host/scenes/demo/%s.yaml" % ("two_tools" if name == "second" else "demo")).read_text()
        scene.write_text(re.sub(r"^effects: .*$", EFFECTS[name], text, flags=re.MULTILINE))
        gesture = place / "effects.gesture"
        gesture.write_text(EFFECTS_GESTURE)
        super().__init__(place, scene, gesture, [])


def check_native(r):
    losses = sum(a and not b for a, b in zip(r.touching, r.touching[1:]))
    lost = len(r.rows) - len(emulated.frames(r.answers, 0x181))
    said = "%d ticks, %d in contact, lost %d times; %d samples lost" % (len(r.rows), sum(r.touching), losses, lost)
    print("# " + said)
    result(losses >= 3 and lost > len(r.rows) // 100 and sum(r.touching) > 1000,
           "the recording has contact, contact lost and samples lost", said)
    process = emulated.native(r.bank, r.answers, r.here)
    # The session ends at its last tick; the port goes on until it finds the input's end, half a tick later.
    result(process.returncode == 0
           and emulated.frames(r.here, emulated.TORQUES)[:len(r.rows)] == emulated.logged(r.log, emulated.TORQUES),
           "the native port answers the recording with the torques of the run", process.stderr)


def replay(port, r, plugin):
    there, again = r.place / port.name, r.place / "again"
    begin = time.monotonic()
    first, said = emulated.count_ticks(port, plugin, r.bank, r.answers, there, r.place / "ticks", "node_finish_tick", "node_transmit")
    seconds = time.monotonic() - begin
    print("# %s: %d ticks at %d ticks/s, %d instructions in the worst; %s" % (
        port.title, len(r.rows), len(r.rows) / seconds, max(first), said.strip()))
    torques = emulated.frames(there, emulated.TORQUES)
    result(len(torques) >= len(r.rows) and torques == emulated.frames(r.here, emulated.TORQUES),
           port.title + ": its torque frames are the native port's")
    result(there.read_bytes() == r.here.read_bytes(), port.title + ": and so are all frames, and the times at which it waits")
    stack = int(said.split("stack ")[1].split()[0])
    result(0 < stack <= STACK_MOST, "%s: the stack that was ever in use is at most %d bytes" % (port.title, STACK_MOST), stack)
    second, _ = emulated.count_ticks(port, plugin, r.bank, r.answers, again, r.place / "ticks", "node_finish_tick", "node_transmit")
    result(again.read_bytes() == there.read_bytes(), port.title + ": a second run gives the same frames")
    result(len(first) >= len(r.rows) and first == second, port.title + ": and takes the same instructions, tick by tick")

    if port.name == "cortex_r5_zcu102":
        counted = {word: int(number) for word, number in re.findall(r"(received|sent|refused|overflows) (\d+)", said)}
        given, taken = len(emulated.frames(r.answers)), len(emulated.frames(there))
        result(counted == {"received": given, "sent": taken, "refused": 0, "overflows": 0},
               "%s: no frame is lost between the host and its CAN controller" % port.title,
               "%s; given %d, taken %d" % (counted, given, taken))
        print("# given %d frames, taken %d" % (given, taken))
    else:
        process = port.emulate(["nowhere/in", r.place / "out"], r.bank)
        result(process.returncode == 3 and "cannot be opened" in process.stderr,
               port.title + ": an input that is not there is said", process.stderr)

    process = port.emulate([r.answers, there], r.damaged)
    expected = emulated.native(r.damaged, r.answers, again)
    emergencies = emulated.frames(there, emulated.EMERGENCY)
    result(process.returncode == expected.returncode == 6 and len(emergencies) == 1
           and emergencies[0][:2] == b"\x00\x63" and there.read_bytes() == again.read_bytes(),
           port.title + ": a damaged bank is refused with the same emergency frame", process.stderr)


def converse(port, r):
    """With this process at the other end of two pipes, an answer for each question, as long as it likes."""
    answers = r.answers.read_bytes()
    batches, begin = [], 0
    for at in range(0, len(answers), emulated.RECORD.size):
        if emulated.RECORD.unpack_from(answers, at)[3] == emulated.TIME:
            batches.append(answers[begin:at + emulated.RECORD.size])
            begin = at + emulated.RECORD.size
    batches = batches[:2 * LIVE_TICKS]
    short, expected = r.place / "short", r.place / "short.native"
    short.write_bytes(b"".join(batches))
    emulated.native(r.bank, short, expected)

    names = [r.place / ("%s.%s" % (port.name, way)) for way in ("in", "out")]
    for name in names:
        os.mkfifo(name)
    signal.alarm(emulated.SECONDS)  # an emulator that never opens its pipes
    process = subprocess.Popen(port.command(names, r.bank), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                               stderr=subprocess.DEVNULL, env=emulated.QUIET)
    heard = b""
    with open(names[0], "wb", buffering=0) as to, open(names[1], "rb") as back:
        for batch in batches:
            while True:  # until it asks
                record = back.read(emulated.RECORD.size)
                heard += record
                if len(record) < emulated.RECORD.size or emulated.RECORD.unpack(record)[3] == emulated.TIME:
                    break
            for at in range(0, len(batch), 5):  # in pieces that are no records
                to.write(batch[at:at + 5])
        to.close()
        heard += back.read()
    code = process.wait(60)
    signal.alarm(0)
    result(code == 0 and heard == expected.read_bytes(),
           "%s: %d ticks against a live process at the other end, the same frames" % (port.title, LIVE_TICKS),
           "code %d, %d bytes of %d" % (code, len(heard), expected.stat().st_size))


def replay_effects(port, r, plugin):
    """Every effect gives the same torques too."""
    there = r.place / "effects.there"
    instructions, said = emulated.count_ticks(port.with_effects(), plugin, r.bank, r.answers, there, r.place / "ticks",
                                              "node_finish_tick", "node_transmit")
    print("# %s with %s: %d ticks, %d instructions in the worst; %s" % (port.title, r.name, len(r.rows), max(instructions),
                                                                      said.strip()))
    result(there.read_bytes() == r.here.read_bytes(), "%s: with %s all frames are the native port's too" % (port.title, r.name))
    stack = int(said.split("stack ")[1].split()[0])
    result(0 < stack <= STACK_MOST, "%s: with %s the stack is at most %d bytes too" % (port.title, r.name, STACK_MOST), stack)
    process = port.emulate([r.answers, there], r.bank)
    result(process.returncode == 6 and len(emulated.frames(there, emulated.EMERGENCY)) == 1,
           "%s: an image without %s refuses that bank" % (port.title, r.name), process.stderr)


def faults(port, place):
    """The port's start-up code under a program that does what it must not."""
    image = place / "faults.elf"
    objects = [path for path in port.objects(".o") if "ports" in path.parts and path.stem not in ("controller", "streams")]
    subprocess.run(["arm-none-eabi-gcc", *port.flags, "-std=c11", "-O1", "-Wall", "-Werror", "-ffreestanding", "-nostdlib",
                    "-static", "-T", port.source / port.script, "-Ifirmware", "tests/rig/faults.c", *objects, "-o", image],
                   check=True)
    answers, out = place / "nothing", place / "out"
    answers.touch()
    allowed = port.emulate([answers, out, "-"], image=image)
    for letter, what in FAULTS:
        process = port.emulate([answers, out, letter], image=image)
        result(allowed.returncode == 0 and process.returncode == 10 and process.stderr.startswith("controller: fault ")
               and re.search(REPORTS[port.name][letter], process.stderr), "%s: %s is a fault that is reported" % (port.title, what),
               "%d %s; without it: %d %s" % (process.returncode, process.stderr, allowed.returncode, allowed.stderr))
        print("# " + process.stderr.strip())


def main():
    print("1..%d" % (2 + len(EFFECTS) + CHECKS * len(emulated.PORTS)))
    with tempfile.TemporaryDirectory(prefix="trocar-replay-") as place:
        place = pathlib.Path(place)
        recording = DemoRecording(place)
        check_native(recording)
        effects = [EffectsRecording(place, name) for name in EFFECTS]
        for r in effects:
            process = emulated.native(r.bank, r.answers, r.here, emulated.NATIVE_WITH_EFFECTS)
            result(process.returncode == 0 and emulated.frames(r.here, emulated.TORQUES)[:len(r.rows)]
                   == emulated.logged(r.log, emulated.TORQUES),
                   "the native port with %s answers its recording with the torques of the run" % r.name, process.stderr)
        plugin = emulated.build_plugin(place)
        for port in emulated.PORTS:
            why = port.missing()
            if why:
                for _ in range(CHECKS):
                    result(False, port.title, skip=why)
                continue
            replay(port, recording, plugin)
            converse(port, recording)
            for r in effects:
                replay_effects(port, r, plugin)
            faults(port, place)
    return 1 if failed else 0


sys.exit(main())
