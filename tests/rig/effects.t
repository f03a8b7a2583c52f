#!/usr/bin/env python3
# not sanitised: it runs images of the native port, which are built once
"""The image that `make firmware` makes for a scene has what the scene names, gives the torques of the image that has every
effect, bit for bit, and an image without one of a bank's effects refuses it and says which."""

import os
import pathlib
import struct
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE]
import effects
import emulated

EFFECT_REFUSED = -409  # STATUS_BANK_EFFECT
NATIVE = emulated.BUILD / "firmware/native"
TABLE = effects.table()

count = 0
failed = False


def result(good, claim, note=""):
    global count, failed
    count += 1
    failed = failed or not good
    print("%sok %d - %s" % ("" if good else "not ", count, claim))
    if note and not good:
        print("# " + str(note)[:1500].replace("\n", "\n# "))
    sys.stdout.flush()


def run(image, bank, answers):
    with open(answers, "rb") as source:
        return subprocess.run([image, bank], stdin=source, capture_output=True, timeout=emulated.SECONDS)


def make_firmware(scene):
    environment = {key: value for key, value in os.environ.items() if key not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")}
    return subprocess.run(["make", "--no-print-directory", "firmware", "SCENE=%s" % scene, "PORT=native", "B=%s" % emulated.BUILD],
                          capture_output=True, text=True, env=environment)


def check(place, name):
    scene = effects.scene(place, "lean-" + (name or "base"), effects.example(name) if name else "{}")
    bank, answers = place / "bank", place / "answers"
    emulated.build_bank(bank, scene)
    emulated.record(bank, "slide", answers, place / "log", "--ticks", 1500)
    made = make_firmware(scene)
    image = NATIVE / scene.stem / "controller.elf"
    lean = run(image, bank, answers) if made.returncode == 0 else None
    everything = run(NATIVE / "all/controller.elf", bank, answers)
    same = lean and lean.returncode == 0 and everything.returncode == 0 and lean.stdout == everything.stdout
    moved = len({data[:6] for *_, kind, data in emulated.RECORD.iter_unpack(everything.stdout) if kind == emulated.FRAME}) > 100
    result(same and moved, "%s: its own image and that of every effect send the same frames" % (name or "no effect"),
           made.stderr + (lean.stderr.decode() if lean else ""))
    if not name:
        return
    base = run(NATIVE / "controller.elf", bank, answers)
    said = [struct.unpack_from("<hH", data, 4) for identifier, _, _, kind, data in emulated.RECORD.iter_unpack(base.stdout)
            if kind == emulated.FRAME and identifier == emulated.EMERGENCY]
    result(base.returncode == 6 and "lacks the effect " + name in base.stderr.decode(),
           "%s: an image without it refuses the bank and names it" % name, base.stderr.decode())
    result(any(reason == EFFECT_REFUSED and lacking >> int(bit_of(name)) & 1 for reason, lacking in said),
           "%s: and says so on the bus" % name, said)


def bit_of(name):
    return next(bit for bit, _, other, *_ in TABLE if other == name)


def main():
    print("1..%d" % (1 + 3 * len(TABLE)))
    with tempfile.TemporaryDirectory(prefix="trocar-lean-") as folder:
        place = pathlib.Path(folder)
        check(place, "")
        for _, _, name, *_ in TABLE:
            check(place, name)
    return 1 if failed else 0


sys.exit(main())
