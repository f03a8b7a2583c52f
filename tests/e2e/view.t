#!/usr/bin/env python3
"""The page in a browser: `trocar view` in real time, headless Chromium looking at it. Skipped without a browser.

SCREENSHOT=file.png  also keeps a picture of the page, 1280 x 800
SCENE=file.yaml      look at this body instead of the block that the test makes"""
import os
import pathlib
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import view_browser  # noqa: E402
from view_browser import LARGE, PATIENCE_S, SMALL, TROCAR, Skip, View, clean, frames_per_second, look  # noqa: E402


def rounded_block(path):
    """A block of 16 x 10 x 6 cm with round edges, 6 tetrahedra per cell, as Gmsh 2."""
    n, half = (12, 8, 5), (0.08, 0.05, 0.03)
    number = {}
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str((n[0] + 1) * (n[1] + 1) * (n[2] + 1))]
    for k in range(n[2] + 1):
        for j in range(n[1] + 1):
            for i in range(n[0] + 1):
                p = [2 * i / n[0] - 1, 2 * j / n[1] - 1, 2 * k / n[2] - 1]
                largest, length = max(map(abs, p)), sum(x * x for x in p) ** 0.5
                round_off = 1 - 0.55 * (1 - largest / length) if length else 1  # pulls edges and corners in
                number[i, j, k] = len(number) + 1
                lines.append("%d %.9g %.9g %.9g" % (number[i, j, k], *(h * x * round_off for h, x in zip(half, p))))
    tetrahedra = []
    for i in range(n[0]):
        for j in range(n[1]):
            for k in range(n[2]):
                for order in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)):
                    corner, path_ = [i, j, k], [(i, j, k)]
                    for axis in order:
                        corner[axis] += 1
                        path_.append(tuple(corner))
                    tetrahedra.append([number[c] for c in path_])
    lines += ["$EndNodes", "$Elements", str(len(tetrahedra))]
    lines += ["%d 4 2 1 1 %d %d %d %d" % (e + 1, *t) for e, t in enumerate(tetrahedra)]
    path.write_text("\n".join(lines + ["$EndElements", ""]))


def organ_moves_and_force_rises(page, work):
    with View(work / "bank", "press") as view:
        look(page, view.address)
        assert page.run("return trocar.webgl"), "the browser has no WebGL"
        page.until("return trocar.state === 'RUN'", "the state is RUN", PATIENCE_S)
        page.until("return trocar.largest_displacement_mm > 1", "the organ moves by more than 1 mm", PATIENCE_S)
        page.until("return trocar.force_history.some((p, i, all) => i > 0 && p.force_N < 0.002 &&"
                   " all.slice(i, i + 200).some((q) => q.force_N > 0.5 * trocar.peak_force_N && q.force_N > 0.02))",
                   "the force rises from nothing", PATIENCE_S)
        rate = frames_per_second(page)
        print("# %.1f frames per second of the run, largest displacement %.1f mm, peak force %.2f N"
              % (rate, *page.run("return [trocar.largest_displacement_mm, trocar.peak_force_N]")))
        assert rate >= 25, "only %.1f frames per second of the run" % rate
        clean(page, view.address)


def keys_press_and_the_picture_changes(page, work):
    rest = work / "rest.txt"
    rest.write_text("hold 3600 s\n")
    with View(work / "bank", rest) as view:
        look(page, view.address)
        page.until("return trocar.state === 'RUN' && trocar.displacement_mm < 0.01", "all is at rest", PATIENCE_S)
        before, tip = page.picture("#canvas"), page.run("return trocar.tip_m")
        page.run("document.getElementById('canvas').focus()")
        for _ in range(60):  # 2 mm and more each; a key that is held goes too deep when the machine is busy
            if page.run("return trocar.displacement_mm > 5"):
                break
            page.keys(*2 * (("down", "e"), ("up", "e")))
        page.until("return trocar.displacement_mm > 5", "the key presses the tool in", PATIENCE_S)
        page.until("return trocar.driven && trocar.force_N > 0.02", "the force is felt", PATIENCE_S)
        after, moved = page.picture("#canvas"), page.run("return trocar.tip_m")
        assert sum((a - b) ** 2 for a, b in zip(tip, moved)) ** 0.5 > 0.005, "the tip did not follow"
        changed = view_browser.differing(before, after)
        print("# %d pixels differ" % changed)
        # 5 mm of an organ of 16 cm that is some 200 pixels wide: the dent and the tool cover hundreds of pixels
        assert changed > 300, "the picture shows nothing of it"

        before = page.run("return trocar.hand_m")
        page.keys(("down", "\ue014"), ("up", "\ue014"))  # arrow to the right
        page.until("const h = trocar.hand_m; return Math.hypot(h[0] - %r, h[1] - %r) > 0.0015" % tuple(before[:2]),
                   "the arrow moves the hand across", PATIENCE_S)
        page.keys(("down", " "), ("up", " "))
        page.until("return !trocar.driven && trocar.displacement_mm < 0.01", "the hand goes back", PATIENCE_S)
        clean(page, view.address)


def stop_and_acknowledge(page, work):
    with View(work / "bank", "hold") as view:
        look(page, view.address)
        page.until("return trocar.state === 'RUN'", "the state is RUN", PATIENCE_S)
        page.click("#stop")
        page.until("return trocar.state === 'SAFE' && document.getElementById('state').textContent === 'SAFE'",
                   "the state is SAFE", PATIENCE_S)
        page.until("return !document.getElementById('acknowledge').hidden", "the button appears", PATIENCE_S)
        page.click("#acknowledge")
        page.until("return trocar.state === 'RUN'", "it runs again", PATIENCE_S)
        clean(page, view.address)


def the_end_of_the_run_is_shown(page, work):
    with View(work / "bank", "hold") as view:
        look(page, view.address)
    page.until("return !trocar.connected && document.getElementById('state').textContent === 'OFFLINE'",
               "the page says so", PATIENCE_S)


def works_without_webgl(_, work):
    with View(work / "bank", "press") as view, view_browser.Browser(*SMALL, ["--disable-3d-apis"]) as page:
        look(page, view.address)
        assert not page.run("return trocar.webgl")
        assert not page.run("return document.getElementById('no-webgl').hidden"), "the reason is not shown"
        page.until("return trocar.peak_force_N > 0.02", "the force is shown all the same", PATIENCE_S)


def screenshot(page, work):
    if not os.environ.get("SCREENSHOT"):
        raise Skip("SCREENSHOT is not set")
    gesture = work / "pressed.txt"
    gesture.write_text("approach 0.5 s\npress 18 mm in 0.5 s\nhold 1.5 s\npress 6 mm in 0.4 s\npress 14 mm in 0.3 s\n"
                       "hold 0.6 s\npress 3 mm in 0.5 s\npress 18 mm in 0.6 s\nhold 4.5 s\nretract 0.6 s\n")
    page.size(*LARGE)
    with View(work / "bank", gesture) as view:
        look(page, view.address)
        page.until("return trocar.time_s > 10", "the trace is full", PATIENCE_S)
        for _ in range(30):  # until the tool was pressed in all the time that the picture took
            page.until("return trocar.force_N > 0.95 * trocar.peak_force_N", "the tool is pressed in", PATIENCE_S)
            since = page.run("return trocar.time_s")
            picture = page.png()
            if page.run("return trocar.force_history.every((p) => p.time_s < %r ||"
                        " p.force_N > 0.95 * trocar.peak_force_N)" % since):
                break
        else:
            raise AssertionError("the machine is too busy for a picture of the pressed organ")
        pathlib.Path(os.environ["SCREENSHOT"]).write_bytes(picture)


CLAIMS = (organ_moves_and_force_rises, keys_press_and_the_picture_changes, stop_and_acknowledge,
          the_end_of_the_run_is_shown, works_without_webgl, screenshot)


def main():
    reason = view_browser.missing()
    if reason:
        print("1..0 # SKIP " + reason)
        return 0
    with tempfile.TemporaryDirectory(prefix="trocar-view-") as folder, view_browser.Browser(*SMALL) as page:
        work = pathlib.Path(folder)
        if os.environ.get("SCENE"):
            command = [os.environ["SCENE"]]
        else:
            rounded_block(work / "block.msh")
            command = [str(work / "block.msh"), "--extent", "0.16"]
        subprocess.run([TROCAR, "build", *command, "-o", str(work / "bank")], check=True, stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL)
        return view_browser.report(CLAIMS, page, work)


sys.exit(main())
