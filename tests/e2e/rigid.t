#!/usr/bin/env python3
"""What does not give way, from the outside: two instruments whose hands cross stop each other, a rib beside the organ stops one; full
finite elements with the same contacts agree; and obstacles where an instrument comes in are refused with their line."""

import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
import tap

TROCAR = str(pathlib.Path(os.environ.get("B", "build")) / "trocar")
DEMO = pathlib.Path("host/scenes/demo").resolve()
CROSS = "approach 0.3 s\npress 10 mm in 0.3 s\nslide %d mm 0 mm in 0.6 s\nhold 0.3 s\n"
RIB = "{name: rib, hull: [[-0.019, -0.12, 0.12], [-0.019, -0.04, 0.14]], radius: 4 mm}"


def scene(folder, demo, effects, name):
    text = (DEMO / (demo + ".yaml")).read_text().replace("file: liver.geo", "file: %s" % (DEMO / "liver.geo"))
    text = re.sub(r"^budget:.*$", "", text, flags=re.MULTILINE)
    path = folder / (name + ".yaml")
    path.write_text(re.sub(r"^effects:.*$", "effects: " + effects, text, flags=re.MULTILINE))
    return path


def run(folder, demo, effects, name, *options):
    path, bank = scene(folder, demo, effects, name), folder / (name + ".bank")
    for words in (["build", path, "--plain", "-o", bank], ["run", path, "--bank", bank, "--json", *options]):
        done = subprocess.run([TROCAR, *map(str, words)], capture_output=True, text=True, timeout=300)
        if done.returncode:
            raise RuntimeError(done.stderr)
    return json.loads(done.stdout)


def main():
    with tempfile.TemporaryDirectory(prefix="trocar-rigid-") as place:
        folder = pathlib.Path(place)
        hands = []
        for number, way in enumerate((60, -60)):
            hand = folder / ("hand%d" % number)
            hand.write_text(CROSS % way)
            hands += ["--gesture", hand]
        apart = run(folder, "two_tools", "{}", "apart", *hands)
        met = run(folder, "two_tools", "{rigid: {cannula: {radius: 6 mm, inside: 20 mm}}}", "met", *hands)
        most = [[i["from_other_N"] for i in r["instruments"]] for r in (apart, met)]
        tap.check("hands that cross pass through each other without the effect, and stop each other with it",
                  max(most[0]) < 0.5 and min(most[1]) > 2, most)
        tap.check("full finite elements with the same contacts agree to 0.1 %",
                  met["force_error_vs_fem"] is not None and met["force_error_vs_fem"] < 1e-3 and met["peak_fem_force_N"] > 2, met)
        free = run(folder, "demo", "{}", "free", "--gesture", "slide")
        held = run(folder, "demo", "{rigid: {obstacles: [%s]}}" % RIB, "held", "--gesture", "slide")
        tap.check("a rib beside the shaft stops a slide", free["peak_force_N"] < 1 and held["peak_force_N"] > 2,
                  (free["peak_force_N"], held["peak_force_N"]))
        tap.check("and finite elements agree to 0.1 %", held["force_error_vs_fem"] < 1e-3 and held["peak_fem_force_N"] > 2, held)
        for effect in ("viscoelastic: {prony: [[0.5, 0.1 s]]}", "swing: {modes: 2}", "shape: {jaws: {}}", "friction: {mu: 0.3, sweeps: 20}",
                       "grasp: {sweeps: 20}"):
            name = effect.split(":")[0]
            both = run(folder, "demo", "{rigid: {shaft: 5 mm, obstacles: [%s]}, %s}" % (RIB, effect), name, "--gesture", "slide")
            tap.check("with %s too" % name, both["force_error_vs_fem"] is not None and both["force_error_vs_fem"] < 1e-3
                      and both["peak_fem_force_N"] > 2, both)
        bad = scene(folder, "demo", "{rigid: {obstacles: [%s]}}" % RIB.replace("-0.019", "-0.03"), "bad")
        line = 1 + bad.read_text().split("\n").index(next(row for row in bad.read_text().split("\n") if row.startswith("effects")))
        done = subprocess.run([TROCAR, "build", str(bad), "-o", str(folder / "none.bank")], capture_output=True, text=True, timeout=300)
        tap.check("an obstacle in an instrument's way in is refused, with its line",
                  done.returncode == 5 and "%s:%d" % (bad, line) in done.stderr
                  and "'right' is inside the obstacle 'rib' when it is drawn back" in done.stderr, done.stderr)
    tap.finish()


main()
