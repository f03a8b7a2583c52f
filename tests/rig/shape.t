#!/usr/bin/env python3
# not sanitised: it counts a controller's image
"""The table of shared/effects/shape.md says what it says: how far the force of a capsule of so many spheres is from that of the capsule
(tests/accuracy/test_shape_samples.c), and the instructions of a tick on the emulated Cortex-M7 in which the shaft lies on the organ, the
rows of the bank at hand, in an image that has this effect.

shape.t [--table]    --table: print the table
"""

import os
import pathlib
import re
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE]
import effects
import emulated

SCENE = pathlib.Path("host/scenes/demo/shape.yaml")
PAGE = pathlib.Path("shared/effects/shape.md")
LAID = "approach 0.3 s\npress 45 mm in 0.5 s\nslide 0 mm -6 mm in 0.3 s\nhold 0.2 s\nslide 10 mm 0 mm in 0.3 s\n"
SAMPLES = (2, 4, 8, 16)
HEAD = "| spheres | force error, mean | worst | instructions, mean | worst |\n|---|---|---|---|---|\n"
COMPILER = 0.03  # by which releases of a compiler may differ in what they make of the same code


def errors():
    said = subprocess.run([emulated.BUILD / "tests/accuracy/test_shape_samples"], capture_output=True, text=True)
    if said.returncode:
        raise RuntimeError(said.stdout + said.stderr)
    found = re.findall(r"samples (\d+): force error mean ([\d.]+) %, worst ([\d.]+) %", said.stdout)
    return {int(samples): ("%.1f %%" % float(mean), "%.1f %%" % float(worst)) for samples, mean, worst in found}


def counts(place):
    plugin, (port, *_) = emulated.build_plugin(place), effects.image("shape")
    gesture, scene, bank = place / "laid.gesture", place / "shaft.yaml", place / "shaft.bank"
    gesture.write_text(LAID)
    text = re.sub(r"\n *jaws:.*", "", SCENE.read_text()).replace("file: ", "file: %s/" % SCENE.parent.resolve())
    found = {}
    for samples in SAMPLES:
        scene.write_text(re.sub(r"samples: \d+", "samples: %d" % samples, text))
        emulated.build_bank(bank, scene)
        mean, worst, most = effects.count(place, plugin, port, bank, gesture)
        if most < (samples + 1) // 2:
            raise RuntimeError("of %d spheres at most %d touch: the shaft no longer lies on the organ" % (samples, most))
        found[samples] = (round(mean), worst)
    return found


def main():
    if "--table" in sys.argv[1:]:
        with tempfile.TemporaryDirectory(prefix="trocar-shape-") as folder:
            error, count = errors(), counts(pathlib.Path(folder))
        print(HEAD + "".join("| %d | %s | %s | %d | %d |\n" % (n, *error[n], *count[n]) for n in SAMPLES), end="")
        return 0
    page = {int(row[0]): row[1:] for row in re.findall(r"^\| (\d+) \| (\S+ %) \| (\S+ %) \| (\d+) \| (\d+) \|$", PAGE.read_text(),
                                                       re.MULTILINE)}
    print("1..2")
    error = errors()
    good = HEAD in PAGE.read_text() and {n: row[:2] for n, row in page.items()} == error
    print("%sok 1 - the page has the force error of each number of spheres" % ("" if good else "not "))
    if not good:
        print("# measured: %s\n# on the page: %s" % (error, page))
    why = effects.PORT.missing()
    if why:
        print("ok 2 - and the instructions of a tick # SKIP " + why)
        return 0 if good else 1
    with tempfile.TemporaryDirectory(prefix="trocar-shape-") as folder:
        count = counts(pathlib.Path(folder))
    same = set(count) == set(page) and all(abs(int(page[n][2 + k]) / count[n][k] - 1) <= COMPILER for n in count for k in range(2))
    print("%sok 2 - and the instructions of a tick" % ("" if same else "not "))
    if not same:
        print("# counted: %s\n# on the page: %s" % (count, page))
    return 0 if good and same else 1


if __name__ == "__main__":
    sys.exit(main())
