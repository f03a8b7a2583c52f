#!/usr/bin/env python3
# not sanitised: it measures the controller's images, which are built once
"""The build's bound of the worst tick (host/bank/worst_tick.h) with each effect, against ticks counted on the emulated Cortex-M7.

The bank is plain, so that reading rows, which budgets.t holds against the bound, takes no part. The tools: ten points near each other,
whose triangles share vertices, and sixteen as far apart as the demo's organ lets them. The motions: across the surface at 1 m/s, and two
that no hand could make, with samples lost and the tool elsewhere after. An effect of shared/effects.def joins by itself.
"""

import os
import pathlib
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE]
import effects
import emulated

TEN_FRICTIONAL_CONTACTS = 120000  # instructions that they may take, rows at hand
MOST = 2.4  # times the worst tick: the bound has all sweeps with all their steps, all contacts, and no vertex that two share
STEPS = 6  # of the solver without friction: a motion takes no more, and the bound counts every one
TOOLS = [("ten points on 5 mm", 10, 5), ("sixteen points on 20 mm", 16, 20)]
JAWS_MM = 20
STROKES = ("approach 0.3 s\npress %d mm in 0.3 s\n%s" + "slide 40 mm 0 mm in 0.075 s\nslide -40 mm 0 mm in 0.075 s\n" * 5)
PRESS = "approach 0.3 s\npress %d mm in 0.3 s\n%shold 2 s\n"
MOTIONS = [(STROKES, 10, ["--jumps", 400, "--period", 6]), (PRESS, 12, ["--jumps", 1000])]


def scene(place, name, points, radius_mm):
    points -= {"rigid": 1, "second": 6}.get(name, 0)  # one of its contacts, or the other tip's points, are of the sixteen
    example = effects.example(name) if name else "{}"
    if name == "shape":  # jaws wide open, so that all spheres touch where the points do
        example = "{shape: {shaft: {length: 2 mm, samples: 2}, jaws: {radius: %d mm, length: %d mm, opening: 180 deg, samples: %d}}}" % (
            radius_mm / 2, JAWS_MM, points / 2 - 1)
    path = effects.scene(place, "%s-%d" % (name or "base", points), example)
    text = path.read_text()
    for old, new in [("points: 10", "points: %d" % points), ("radius: 5 mm", "radius: %d mm" % radius_mm),
                     ("{steps: 24}", "{steps: %d}" % STEPS)]:
        if old not in text:
            raise RuntimeError("the demo's scene no longer says " + old)
        text = text.replace(old, new)
    path.write_text(text)
    return path


def worst(place, plugin, port, bank, name, begin="node_finish_tick", end="node_transmit"):
    """Instructions from one function to another, the most of all motions; the jaws close where the tool presses, if it has some
    that do, or are pressed themselves, behind the tip."""
    most = 0
    for number, (motion, depth_mm, options) in enumerate(MOTIONS):
        gesture, answers, log = (place / (word + str(number)) for word in ("gesture", "answers", "log"))
        deeper_mm = JAWS_MM if name == "shape" else 0
        gesture.write_text(motion % (depth_mm + deeper_mm, "close 0.1 s\n" if name == "grasp" else ""))
        emulated.record(bank, gesture, answers, log, *options)
        ticks, _ = emulated.count_ticks(port, plugin, bank, answers, place / "out", place / "ticks", begin, end)
        most = max(most, *ticks)
    return most


def main():
    port = emulated.CortexM7()
    cases = [("", "base")] + [(name, name) for _, _, name, *_ in effects.table()]
    print("1..%d" % (1 + len(cases) * len(TOOLS)))
    failed, number, why = False, 0, port.missing()
    with tempfile.TemporaryDirectory(prefix="trocar-worst-") as folder:
        place = pathlib.Path(folder)
        plugin = None if why else emulated.build_plugin(place)
        for name, title in cases:
            for tool, points, radius_mm in TOOLS:
                number += 1
                claim = "%s, %s: the bound is above every tick, and within %g times the worst" % (title, tool, MOST)
                if why:
                    print("ok %d - %s # SKIP %s" % (number, claim, why))
                    continue
                bank = place / "bank"
                bound = emulated.build_bank(bank, scene(place, name, points, radius_mm), "--plain")["worst_tick_instructions"]
                counted = worst(place, plugin, port.with_effects() if name else port, bank, name)
                good = counted <= bound <= MOST * counted
                failed = failed or not good
                print("%sok %d - %s\n# %d of %d, %.2f" % ("" if good else "not ", number, claim, counted, bound, bound / counted))
                sys.stdout.flush()
                if (name, points) == ("friction", 10):
                    contact = worst(place, plugin, port.with_effects(), bank, name, "contact_admit", "contact_expect")
        number += 1
        good = why or contact <= TEN_FRICTIONAL_CONTACTS
        failed = failed or not good
        print("%sok %d - ten contacts with friction are solved in at most %d instructions%s" % (
            "" if good else "not ", number, TEN_FRICTIONAL_CONTACTS, " # SKIP " + why if why else "\n# %d" % contact))
    return 1 if failed else 0


sys.exit(main())
