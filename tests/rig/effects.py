#!/usr/bin/env python3
"""What each effect costs and what it changes, as a table in Markdown (make effects).

Flash and memory: the Cortex-M7's image of a scene that names the effect, less that of one that names none. Bank: bytes of its
section and the section's entry. Instructions: of a tick in contact with its rows at hand (node_finish_tick, counted by QEMU),
with ten points on the tip of the demo's instrument, pressing and sliding; in brackets without the effect. Changes: the largest
difference that the effect makes to a torque on the recording of a slide, in parts of the largest torque. Error: the controller's
force against full finite elements under the same law (trocar run; of neo_hookean and quasi_nonlinear the linear force that they correct), in
parts of the largest force.
"""

import json
import os
import pathlib
import re
import struct
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE]
import emulated

EFFECT = re.compile(r'^EFFECT\((\d+), *([A-Z_]+), *([a-z_]+), *(\w+), *"([^"]*)", *"([^"]*)"', re.MULTILINE)
DEMO = pathlib.Path("host/scenes/demo/demo.yaml")
PORT = emulated.CortexM7()
BEGIN, END = "node_finish_tick", "node_transmit"


def table():
    """Bit, name in capitals, name, section, parts and what it adds, of every effect."""
    return EFFECT.findall(pathlib.Path("shared/effects.def").read_text())


SECOND = """  - name: left
    trocar: {at: [0.055, -0.105, 0.17], axis: [-0.36, 0.42, -0.86]}
    length: 0.10..0.23 m
    tip: {radius: 5 mm, points: 6}
    device: impulse-engine
"""


def example(name):
    """The first line of code of the effect's page: how a scene names it. A second instrument is named by its entry."""
    if name == "second":
        return SECOND
    page = pathlib.Path("shared/effects/%s.md" % name).read_text()
    return re.search(r"^`effects: (\{.*\})`$", page, re.MULTILINE)[1]


def scene(place, name, effects):
    text, second = re.sub(r"points: \d+", "points: 10", DEMO.read_text()), effects == SECOND
    if second:
        text = text.replace("contact:", SECOND + "contact:", 1)
    text = re.sub(r"^effects:.*$", "effects: " + ("{}" if second else effects), text, flags=re.MULTILINE)
    text = re.sub(r"^budget:.*\n", "", text, flags=re.MULTILINE).replace("file: ", "file: %s/" % DEMO.parent.resolve())
    path = place / (name + ".yaml")
    path.write_text(text)
    return path


def image(name):
    """The image with this effect, or the base; its flash and memory in bytes."""
    port = emulated.CortexM7()
    words = ["IMAGE=" + name, "EFFECTS=" + name] if name else []
    environment = {key: value for key, value in os.environ.items() if key not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")}
    subprocess.run(["make", "--no-print-directory", "image", "PORT=" + port.name] + words, check=True, capture_output=True,
                   env=environment)
    port.image = port.build / name / "controller.elf"
    sizes = {words[0]: int(words[1]) for words in
             map(str.split, subprocess.run(["arm-none-eabi-size", "-A", port.image], check=True, capture_output=True,
                                           text=True).stdout.splitlines()) if len(words) == 3 and words[1].isdigit()}
    at = emulated.symbols(port.image)
    return port, sizes[".text"] + sizes[".data"], at["memory_bss_end"] - at["memory_guard"]


def count(place, plugin, port, bank, gesture):
    """Instructions of the ticks that touch and whose rows are at hand: mean and worst, and the most contacts."""
    answers, log = place / "answers", place / "log.csv"
    emulated.record(bank, gesture, answers, log)
    ticks, _ = emulated.count_ticks(port, plugin, bank, answers, place / "out", place / "ticks", BEGIN, END)
    rows = [line.split(",") for line in log.read_text().split()]
    head = {name: k for k, name in enumerate(rows[0])}
    touching = [n for row, n in zip(rows[1:], ticks) if int(row[head["contacts"]]) > 0 and int(row[head["work"]]) == 0]
    return sum(touching) / len(touching), max(touching), max(int(row[head["contacts"]]) for row in rows[1:])


def torques(place, bank, answers):
    """Of the native image that has every effect."""
    out = place / "native"
    with open(answers, "rb") as source, open(out, "wb") as target:
        subprocess.run([emulated.BUILD / "firmware/native/all/controller.elf", bank], stdin=source, stdout=target, check=True)
    return [struct.unpack("<3h", data[:6]) for data in emulated.frames(out, emulated.TORQUES)]


def main():
    why = PORT.missing()
    if why:
        print(why + ": nothing is measured")
        return 0
    with tempfile.TemporaryDirectory(prefix="trocar-effects-") as folder:
        place = pathlib.Path(folder)
        plugin = emulated.build_plugin(place)
        base_port, base_flash, base_memory = image("")
        base_bank = place / "base.bank"
        emulated.build_bank(base_bank, scene(place, "base", "{}"))
        base = {gesture: count(place, plugin, base_port, base_bank, gesture) for gesture in ("press", "slide")}
        same = place / "same"
        emulated.record(base_bank, "slide", same, place / "log.csv")
        without = torques(place, base_bank, same)
        print("| effect | flash, bytes | memory, bytes | bank, bytes | instructions, press | slide | worst | changes | error |")
        print("|---|---|---|---|---|---|---|---|---|")
        for _, _, name, _, _, what in table():
            port, flash, memory = image(name)
            path, bank = scene(place, name, example(name)), place / (name + ".bank")
            emulated.build_bank(bank, path)
            figures = {gesture: count(place, plugin, port, bank, gesture) for gesture in ("press", "slide")}
            with_it = torques(place, bank, same)
            peak = max(abs(value) for row in without for value in row)
            change = max(abs(a - b) for x, y in zip(with_it, without) for a, b in zip(x, y)) / peak
            run = json.loads(subprocess.run([emulated.TROCAR, "run", path, "--bank", bank, "--gesture", "slide", "--json"],
                                            check=True, capture_output=True, text=True).stdout)
            error = run.get("force_error_vs_fem")
            print("| %s: %s | %d | %d | %d | %.0f (%.0f) | %.0f (%.0f) | %d (%d) | %.0f %% | %s |" % (
                name, what, flash - base_flash, memory - base_memory, bank.stat().st_size - base_bank.stat().st_size,
                figures["press"][0], base["press"][0], figures["slide"][0], base["slide"][0],
                max(f[1] for f in figures.values()), max(f[1] for f in base.values()), 100 * change,
                "%.1e" % error if error is not None else "not known"))
            sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
