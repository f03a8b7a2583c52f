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
        clean(page, view.address)
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
        clean(page, view.address)


CLAIMS = (jaws_close_hold_the_tissue_and_lift_it,)


def main():
    reason = view_browser.missing()
    if reason:
        print("1..0 # SKIP " + reason)
        return 0
    with tempfile.TemporaryDirectory(prefix="trocar-demo-page-") as folder, view_browser.Browser(*SMALL) as page:
        return view_browser.report(CLAIMS, page, pathlib.Path(folder))


sys.exit(main())
