#!/usr/bin/env python3
"""The pages of the demo scenes in a browser: what `make demo SCENE=...` shows is there to be seen. Skipped without a browser.

SCREENSHOTS=folder  also keeps a picture of each page, 1280 x 800"""
import os
import pathlib
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import view_browser  # noqa: E402
from view_browser import LARGE, PATIENCE_S, SMALL, TROCAR, View, clean, look  # noqa: E402

PULL = "approach 0.3 s\npress 8 mm in 0.4 s\nclose 0.2 s\npress -12 mm in 0.8 s\nslide 12 mm 0 mm in 0.5 s\nhold 3600 s\n"
PRESS = "approach 0.3 s\npress 8 mm in 0.4 s\nhold 3600 s\n"


def built(work, scene):
    bank = work / (scene + ".bank")
    if not bank.exists():
        subprocess.run([TROCAR, "build", "host/scenes/demo/%s.yaml" % scene, "-o", str(bank)], check=True, stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL)
    return bank


def gesture(work, name, text):
    (work / name).write_text(text)
    return work / name


def leave(page, view):
    clean(page, view.address)
    page.open("about:blank")  # or it would ask for a view that is gone, while the next scene is built


def keep(page, name):
    if os.environ.get("SCREENSHOTS"):
        page.size(*LARGE)
        (pathlib.Path(os.environ["SCREENSHOTS"]) / (name + ".png")).write_bytes(page.png())
        page.size(*SMALL)


def jaws_close_hold_the_tissue_and_lift_it(page, work):
    with View(built(work, "grasp"), gesture(work, "press.txt", PRESS)) as view:
        look(page, view.address)
        page.until("const i = trocar.instruments[0]; return i.grip === 0 && i.held === 0 && i.force_N > 0.1",
                   "open jaws press", PATIENCE_S)
        pressed, tip = page.picture("#canvas"), page.run("return trocar.tip_m")
        leave(page, view)
    with View(built(work, "grasp"), gesture(work, "pull.txt", PULL)) as view:
        look(page, view.address)
        page.until("const i = trocar.instruments[0]; return i.grip === 1 && i.held > 0 && i.force_N > 0.3 && i.tip_m[2] > %r"
                   % (tip[2] + 0.01), "closed jaws pull it up by a centimetre", PATIENCE_S)
        page.until("return trocar.displacement_mm > 10", "the tissue comes with them", PATIENCE_S)
        pulled = page.picture("#canvas")
        changed = view_browser.differing(pressed, pulled)
        print("# %d pixels differ; %.1f mm, %.2f N" % (changed, *page.run("return [trocar.displacement_mm, trocar.force_N]")))
        # the organ covers more than a tenth of the picture, and all of it has another colour
        assert changed > 0.05 * pressed[0] * pressed[1], "the picture shows nothing of it"
        assert not page.run("return document.getElementById('legend-hold').hidden"), "the legend does not say what is held"
        keep(page, "grasp")
        leave(page, view)


LEAN = "approach 0.3 s\npress 12 mm in 0.4 s\nhold 3600 s\n"


def two_instruments_press_and_each_key_moves_its_own(page, work):
    lean = gesture(work, "lean.txt", LEAN)
    with View(built(work, "two_tools"), lean, lean) as view:
        look(page, view.address)
        page.until("return trocar.state === 'RUN' && trocar.instruments.length === 2 &&"
                   " trocar.instruments.every((i) => i.contacts > 0 && i.force_N > 0.2)", "both press", PATIENCE_S)
        first = page.run("return trocar.instruments")
        tiles = page.run("return [...document.querySelectorAll('.tile.force')].map((tile) => tile.textContent)")
        print("# %s" % tiles)
        assert [tile.split("0.")[0] for tile in tiles] == ["Force, right", "Force, left"], "no readout for each"
        labels = page.run("return [...document.querySelectorAll('.force-label')].map((label) => !label.hidden && label.textContent)")
        assert all(labels) and labels[0] != labels[1], "no force beside each arrow: %s" % labels
        keep(page, "two_tools")
        before = page.picture("#canvas")
        page.run("document.getElementById('canvas').focus()")
        page.keys(("down", "2"), ("up", "2"))
        for _ in range(60):
            if page.run("return trocar.instruments[1].force_N < 0.05"):
                break
            page.keys(*2 * (("down", "q"), ("up", "q")))
        page.until("return trocar.instruments[1].force_N < 0.05", "the key draws the left one out", PATIENCE_S)
        after = page.run("return trocar.instruments")
        assert after[1]["driven"] and not after[0]["driven"], "the key moved the other hand"
        # half of what each feels is the other's doing (demo.t); the hand gives way by some of it
        print("# right: %.3f N, and %.3f N when left is gone" % (first[0]["force_N"], after[0]["force_N"]))
        assert after[0]["force_N"] > 1.05 * first[0]["force_N"], "the right one feels nothing of it"
        assert view_browser.differing(before, page.picture("#canvas")) > 300, "the picture shows nothing of it"
        leave(page, view)


CLAIMS = (jaws_close_hold_the_tissue_and_lift_it, two_instruments_press_and_each_key_moves_its_own)


def main():
    reason = view_browser.missing()
    if reason:
        print("1..0 # SKIP " + reason)
        return 0
    with tempfile.TemporaryDirectory(prefix="trocar-demo-page-") as folder, view_browser.Browser(*SMALL) as page:
        return view_browser.report(CLAIMS, page, pathlib.Path(folder))


sys.exit(main())
