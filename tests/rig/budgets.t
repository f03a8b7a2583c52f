#!/usr/bin/env python3
# not sanitised: it measures the Cortex-M7's image, which is built once
"""What the controller takes on a Cortex-M7: flash, memory, stack, and instructions per tick, held against budgets.txt.

A tick is node_finish_tick: from the encoder sample to the frames that wait to be sent. Its instructions are counted by
QEMU with ticks_plugin.c, on recordings of simulated runs and on one that no hand could make. They say nothing of
microseconds: caches and wait states are not emulated.

budgets.t [--table]    --table: for people (make budgets), with a larger body and with where the worst tick goes
"""

import bisect
import csv
import os
import pathlib
import re
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, "..")]
import emulated
from call_graph import call_graph, deepest

TABLE = "--table" in sys.argv[1:]
PORT = emulated.CortexM7()
PREFIX = "arm-none-eabi-"
BEGIN, END = "node_finish_tick", "node_transmit"  # the loop takes the first frame when the tick is done
LIVER = pathlib.Path(os.environ.get("TROCAR_DATA", "../shared/data")) / "liver_smooth_1665_6691.msh"
MEMORY_FUNCTIONS = {"memcpy", "memmove", "memset", "memcmp"}


def strokes(speed_m_s, length_mm):
    """Across the surface and back, five times. A minimum-jerk motion is 15/8 times as fast at its middle as on average."""
    seconds = 15 / 8 * length_mm * 1e-3 / speed_m_s
    return ("approach 0.3 s\npress 10 mm in 0.3 s\n"
            + ("slide %g mm 0 mm in %.4f s\nslide -%g mm 0 mm in %.4f s\n" % (length_mm, seconds, length_mm, seconds)) * 5
            + "press 0 mm in 0.3 s\n")


RECORDINGS = [  # name, gesture (a word, or text), options of the recorder
    ("press", "press", []),
    ("slide", "slide", []),
    ("slide at 0.3 m/s", strokes(0.3, 40), []),
    ("slide at 1 m/s", strokes(1.0, 40), []),
    ("jumps", "approach 0.3 s\npress 12 mm in 0.3 s\nhold 2 s\n", ["--jumps", 1000]),
    ("tour", "tour", ["--drop", 0.02]),
]

count = 0
failed = False


def result(good, claim, note=""):
    global count, failed
    count += 1
    failed = failed or not good
    if not TABLE:
        print("%sok %d - %s" % ("" if good else "not ", count, claim))
    elif not good:
        print("EXCEEDED: " + claim)
    if note and not good:
        print("# " + str(note))
    sys.stdout.flush()


def say(line=""):
    print(line if TABLE else "# " + line)
    sys.stdout.flush()


def tool(*command):
    return subprocess.run([PREFIX + command[0], *map(str, command[1:])], check=True, capture_output=True, text=True).stdout


def budgets():
    rows = [line.split(None, 2) for line in open(os.path.join(HERE, "budgets.txt")) if line.strip() and line[0] != "#"]
    return {name: (int(most), what.strip()) for name, most, what in rows}


def check(name, measured):
    most, what = budgets()[name]
    result(measured <= most, "%s: %d of %d %s" % (name, measured, most, what))
    if TABLE:
        say("  %-18s %8d of %8d  %s" % (name, measured, most, what))


def functions():
    """Start addresses of the image's functions in order, and their names."""
    found = sorted((int(address, 16) & ~1, name) for address, kind, name in
                   (line.split() for line in tool("nm", PORT.image).splitlines()) if kind in "tT" and name[0] != "$")
    return [address for address, _ in found], [name for _, name in found]


def check_image():
    sizes = {words[0]: int(words[1]) for words in map(str.split, tool("size", "-A", PORT.image).splitlines())
             if len(words) == 3 and words[1].isdigit()}
    symbols = {name: int(address, 16) for address, _, name in
               (line.split() for line in tool("nm", PORT.image).splitlines())}
    check("image", sizes[".text"] + sizes[".data"])
    check("memory", symbols["memory_rows"] - symbols["memory_guard"])
    frame, _, calls = call_graph((emulated.BUILD / "firmware/cortex_m7_an500").rglob("*.ci"))
    (worst, chain), cycles = deepest(frame, calls)
    check("stack", worst)
    say("%s" % " > ".join(name.split(":")[-1] for name in chain))
    result(not cycles, "no recursion in the image", cycles)

    text = PORT.image.with_suffix(".map").read_text()
    loaded = re.findall(r"^LOAD (.*)$", text, re.MULTILINE)
    ours = str(emulated.BUILD / "firmware/cortex_m7_an500") + "/"
    strange = [name for name in loaded if not name.startswith(ours) and name != "linker stubs"]
    result(loaded and not strange and "Archive member included" not in text,
           "the linker's map has the controller's and the port's objects, and no library", strange)
    helpers = [name for name in symbols if re.match(r"__aeabi_|__adddf|__muldf|malloc|free$|calloc|_sbrk|printf", name)]
    result(not helpers, "no helper for double precision, no allocator, no C library", helpers)


def build_plugin(place):
    plugin = place / "ticks.so"
    subprocess.run(["gcc", "-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared", "-fvisibility=hidden",
                    os.path.join(HERE, "ticks_plugin.c"), "-o", plugin], check=True)
    return plugin


def count_ticks(place, plugin, bank, answers, more=""):
    """Instructions of each tick."""
    addresses, names = functions()
    at = {name: address for address, name in zip(addresses, names)}
    ticks = place / "ticks"
    process = PORT.emulate([answers, place / "out"], bank,
                         plugin="%s,begin=%#x,end=%#x,ticks=%s%s" % (plugin, at[BEGIN], at[END], ticks, more))
    if process.returncode != 0:
        raise RuntimeError(process.stderr.strip())
    return [int(line) for line in ticks.read_text().split()], process.stderr


def measure(place, plugin, bank, recording):
    """One recording: instructions and what the controller did, tick by tick; the stack that was in use."""
    name, gesture, options = recording
    path = place / "gesture"
    path.write_text(gesture)
    answers, log = place / "answers", place / "log.csv"
    emulated.record(bank, path if "\n" in gesture else gesture, answers, log, *options)
    instructions, said = count_ticks(place, plugin, bank, answers)
    rows = [{key: int(value) for key, value in row.items()} for row in csv.DictReader(log.open())]
    ticks = [dict(row, instructions=n) for row, n in zip(rows, instructions)]
    at_hand = [t["instructions"] for t in ticks if 1 <= t["contacts"] <= 3 and t["work"] == 0]
    worst = max(range(len(ticks)), key=lambda k: ticks[k]["instructions"])
    touching = [t["instructions"] for t in ticks if t["contacts"]]
    say("  %-18s %6d %6d %3d %9d %9d %9s %9d %6d %5d %7d" % (
        name, len(ticks), len(touching), max(t["contacts"] for t in ticks), sum(touching) / max(1, len(touching)),
        max((t["instructions"] for t in ticks if t["work"] == 0), default=0), max(at_hand) if at_hand else "-",
        ticks[worst]["instructions"], sum(t["rows"] for t in ticks), sum(t["held"] for t in ticks),
        sum(t["waiting"] for t in ticks)))
    return ticks, worst, int(said.split("stack ")[1].split()[0])


def show_profile(place, plugin, bank, tick):
    profile = place / "profile"
    count_ticks(place, plugin, bank, place / "answers", ",profile=%s,first=%d,last=%d" % (profile, tick, tick))
    addresses, names = functions()
    spent = {}
    for line in profile.read_text().splitlines():
        address, instructions = line.split(",")
        name = names[bisect.bisect(addresses, int(address, 16)) - 1]
        spent[name] = spent.get(name, 0) + int(instructions)
    for name, instructions in sorted(spent.items(), key=lambda item: -item[1])[:8]:
        say("      %-30s %8d  %4.1f %%" % (name, instructions, 100 * instructions / sum(spent.values())))


def check_bound(bound, counted, name):
    """What trocar build says of a tick (host/bank/worst_tick.h) is above every one, and is no idle figure: the solver's
    bound of steps and the coefficients' rounding leave less than a factor of two."""
    result(counted <= bound <= 2 * counted, "%s: the stated bound of the worst tick, %d, is above the worst of %d and within "
           "twice that" % (name, bound, counted))
    say("the build's bound of the worst tick: %d, %.2f times the worst that was counted" % (bound, bound / counted))


def measure_scene(place, plugin, *source):
    """All recordings on the bank of a scene or mesh; the bank, and the largest figures."""
    bank = place / "scene.bank"
    built = emulated.build_bank(bank, *source)
    say()
    say("%s, a bank of %d bytes" % (pathlib.Path(source[0]).name, bank.stat().st_size))
    say("  %-18s %6s %6s %3s %9s %9s %9s %9s %6s %5s %7s" % (
        "instructions", "ticks", "touch", "m", "mean", "at hand", "m <= 3", "worst", "rows", "held", "waiting"))
    largest = {"tick": 0, "tick-3-contacts": 0, "stack": 0}
    for recording in RECORDINGS:
        ticks, worst, stack = measure(place, plugin, bank, recording)
        if ticks[worst]["instructions"] > largest["tick"] and TABLE:
            show_profile(place, plugin, bank, worst)
        largest["tick"] = max(largest["tick"], ticks[worst]["instructions"])
        largest["stack"] = max(largest["stack"], stack)
        largest["tick-3-contacts"] = max([largest["tick-3-contacts"]] + [
            t["instructions"] for t in ticks if 1 <= t["contacts"] <= 3 and t["work"] == 0])
    check_bound(built["worst_tick_instructions"], largest["tick"], pathlib.Path(source[0]).name)
    return bank, largest


def check_ticks(place):
    plugin = build_plugin(place)
    bank, largest = measure_scene(place, plugin, "host/scenes/demo/demo.yaml")
    first, again = (count_ticks(place, plugin, bank, place / "answers")[0] for _ in range(2))
    result(first == again and len(first) > 1000, "two runs of a recording take the same instructions, tick by tick")
    if TABLE and LIVER.exists():
        _, liver = measure_scene(place, plugin, LIVER, "--extent", "0.214")
        largest = {name: max(most, liver[name]) for name, most in largest.items()}
    elif TABLE:
        say("%s is not here: the demo alone" % LIVER.name)
    for name, measured in largest.items():
        check(name, measured)


def main():
    why = PORT.missing()
    if why:
        print(why + ": nothing is measured" if TABLE else "1..0 # SKIP " + why)
        return 0
    if not TABLE:
        print("1..11")
    check_image()
    with tempfile.TemporaryDirectory(prefix="trocar-budgets-") as place:
        check_ticks(pathlib.Path(place))
    return 1 if failed else 0


sys.exit(main())
