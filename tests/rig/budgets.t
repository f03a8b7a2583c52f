#!/usr/bin/env python3
# not sanitised: it measures the controller's images, which are built once
"""What the controller takes on each bare-metal port: flash, memory, stack, and where an emulator runs it instructions per
tick, held against budgets.txt.

A tick is node_finish_tick: from the encoder sample to the frames that wait to be sent. Its instructions are counted by
QEMU with ticks_plugin.c, on recordings of simulated runs and on one that no hand could make. They say nothing of
microseconds: caches and wait states are not emulated. A port whose compiler or emulator is not there is skipped.

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
PREFIX = "arm-none-eabi-"
BEGIN, END = "node_finish_tick", "node_transmit"  # the loop takes the first frame when the tick is done
LIVER = pathlib.Path(os.environ.get("TROCAR_DATA", "../shared/data")) / "liver_smooth_1665_6691.msh"


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
    ("hostile", strokes(1.0, 40), ["--jumps", 400, "--period", 6]),
    ("tour", "tour", ["--drop", 0.02]),
]
HOSTILE = [recording for recording in RECORDINGS if recording[0] in ("slide at 1 m/s", "jumps", "hostile")]

count = 0
failed = False


def result(good, claim, note="", skip=None):
    global count, failed
    count += 1
    failed = failed or not (good or skip)
    if not TABLE:
        print("%sok %d - %s%s" % ("" if good or skip else "not ", count, claim, " # SKIP " + skip if skip else ""))
    elif skip:
        print("%s: not measured, %s" % (claim, skip))
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
    """Of each port and figure: the most that it may be, and of what."""
    rows = [line.split(None, 3) for line in open(os.path.join(HERE, "budgets.txt")) if line.strip() and line[0] != "#"]
    return {(port, name): (int(most), what.strip()) for port, name, most, what in rows}


measured = {}  # by port and figure


def check(port, name, figure):
    most, what = budgets()[port.name, name]
    measured[port.name, name] = figure
    result(figure <= most, "%s, %s: %d of %d %s" % (port.title, name, figure, most, what))


def functions(port):
    """Start addresses of the image's functions in order, and their names."""
    found = sorted((int(address, 16) & ~1, name) for address, kind, name in
                   (line.split() for line in tool("nm", port.image).splitlines()) if kind in "tT" and name[0] != "$")
    return [address for address, _ in found], [name for _, name in found]


IMAGE_CHECKS = 7


def check_image(port):
    sizes = {words[0]: int(words[1]) for words in map(str.split, tool("size", "-A", port.image).splitlines())
             if len(words) == 3 and words[1].isdigit()}
    symbols = emulated.symbols(port.image)
    check(port, "image", sizes[".text"] + sizes[".data"])
    check(port, "memory", symbols["memory_bss_end"] - symbols["memory_guard"])
    unknown = [path.name for path in port.objects(".o") if not path.with_suffix(".ci").exists() and
               path.relative_to(port.build).with_suffix(".c").exists()]
    result(symbols["memory_handler_stack_top"] <= symbols["memory_data"] <= symbols["memory_bss"] and not unknown,
           "%s: the variables lie above the stacks, and each object has its call graph" % port.title, unknown)
    frame, _, calls = call_graph(port.objects(".ci"))
    (worst, chain), cycles = deepest(frame, calls)
    check(port, "stack", worst)
    say("%s" % " > ".join(name.split(":")[-1] for name in chain))
    result(not cycles, "%s: no recursion in the image" % port.title, cycles)

    text = port.image.with_suffix(".map").read_text()
    loaded = re.findall(r"^LOAD (.*)$", text, re.MULTILINE)
    strange = [name for name in loaded if not name.startswith(str(port.build) + "/") and name != "linker stubs"]
    result(loaded and not strange and "Archive member included" not in text,
           "%s: the linker's map has the controller's and the port's objects, and no library" % port.title, strange)
    helpers = [name for name in symbols if re.match(r"__aeabi_|__adddf|__muldf|malloc|free$|calloc|_sbrk|printf", name)]
    result(not helpers, "%s: no helper for double precision, no allocator, no C library" % port.title, helpers)


class Recording:
    """One on one bank, answered beforehand; what the controller does in each tick."""

    def __init__(self, place, bank, number, recording):
        self.name, gesture, options = recording
        self.answers, log, path = (place / ("%s.%s.%d" % (bank.stem, word, number)) for word in ("answers", "log", "gesture"))
        path.write_text(gesture)
        emulated.record(bank, path if "\n" in gesture else gesture, self.answers, log, *options)
        self.rows = [{key: int(value) for key, value in row.items()} for row in csv.DictReader(log.open())]


def count_ticks(port, place, plugin, bank, recording, more=""):
    return emulated.count_ticks(port, plugin, bank, recording.answers, place / "out", place / "ticks", BEGIN, END, more)


def measure(port, place, plugin, bank, recording):
    """The ticks of a recording with their instructions, and the stack that was in use."""
    instructions, said = count_ticks(port, place, plugin, bank, recording)
    ticks = [dict(row, instructions=n) for row, n in zip(recording.rows, instructions)]
    touching = [t["instructions"] for t in ticks if t["contacts"]]
    say("  %-18s %6d %6d %3d %9d %9d %9d %9d %6d %5d %7d" % (
        recording.name, len(ticks), len(touching), max(t["contacts"] for t in ticks), sum(touching) / max(1, len(touching)),
        most(ticks, lambda t: t["work"] == 0), most(ticks, few), most(ticks, lambda t: True),
        sum(t["rows"] for t in ticks), sum(t["held"] for t in ticks), sum(t["waiting"] for t in ticks)))
    return ticks, int(said.split("stack ")[1].split()[0])


def few(tick):
    """At most three contacts, and their rows at hand."""
    return 1 <= tick["contacts"] <= 3 and tick["work"] == 0


def most(ticks, which):
    return max((t["instructions"] for t in ticks if which(t)), default=0)


def spent_in(port, place, plugin, bank, recording, first, last):
    """Instructions of each function in some ticks of a recording."""
    profile = place / "profile"
    count_ticks(port, place, plugin, bank, recording, ",profile=%s,first=%d,last=%d" % (profile, first, last))
    addresses, names = functions(port)
    spent = {}
    for line in profile.read_text().splitlines():
        address, instructions = line.split(",")
        name = names[bisect.bisect(addresses, int(address, 16)) - 1].split(".")[0]
        spent[name] = spent.get(name, 0) + int(instructions)
    return spent


def show_profile(port, place, plugin, bank, recording, tick):
    spent = spent_in(port, place, plugin, bank, recording, tick, tick)
    for name, instructions in sorted(spent.items(), key=lambda item: -item[1])[:8]:
        say("      %-30s %8d  %4.1f %%" % (name, instructions, 100 * instructions / sum(spent.values())))


ROWS = ("row_read", "residual", "lengthen", "row_dot")  # functions of firmware/row.c that decode and multiply rows


def check_work(port, place, plugin, bank, recording, name):
    """The row cache's account of its work (firmware/row_cache.h) against what those functions take: on the Cortex-M7, whose
    instructions the account is fitted to, within a tenth."""
    spent = spent_in(port, place, plugin, bank, recording, 0, len(recording.rows))
    counted, work = sum(spent.get(f, 0) for f in ROWS), sum(row["work"] for row in recording.rows)
    result(port.name != "cortex_m7_an500" or abs(work - counted) <= 0.1 * counted,
           "%s, %s: the row cache accounts for %d of the %d instructions that rows take" % (port.title, name, work, counted))
    say("the row cache's account of its work: %.3f of what was counted" % (work / counted))


def check_bound(port, bound, counted, name):
    """What trocar build says of a tick (host/bank/worst_tick.h) is above every one, and is no idle figure: it has all steps
    of the solver, and contacts that share no vertex, while points of a tool share half of theirs."""
    result(counted <= bound <= 2 * counted, "%s, %s: the stated bound of the worst tick, %d, is above the worst of %d and "
           "within twice that" % (port.title, name, bound, counted))
    say("the build's bound of the worst tick: %d, %.2f times the worst that was counted" % (bound, bound / counted))


class Scene:
    def __init__(self, place, plugin, *source, recordings=RECORDINGS):
        self.place, self.plugin, self.by_hand = place, plugin, recordings is RECORDINGS
        self.name = pathlib.Path(source[0]).name
        self.bank = place / (self.name + ".bank")
        self.bound = emulated.build_bank(self.bank, *source)["worst_tick_instructions"]
        self.recordings = [Recording(place, self.bank, number, recording) for number, recording in enumerate(recordings)]

    def measure(self, port):
        """The largest figures of all recordings."""
        say()
        say("%s on %s, a bank of %d bytes" % (self.name, port.title, self.bank.stat().st_size))
        say("  %-18s %6s %6s %3s %9s %9s %9s %9s %6s %5s %7s" % (
            "instructions", "ticks", "touch", "m", "mean", "at hand", "m <= 3", "worst", "rows", "held", "waiting"))
        largest = {"tick": 0, "tick-3-contacts": 0, "stack": 0}
        for recording in self.recordings:
            ticks, stack = measure(port, self.place, self.plugin, self.bank, recording)
            worst = max(range(len(ticks)), key=lambda k: ticks[k]["instructions"])
            if ticks[worst]["instructions"] > largest["tick"] and TABLE:
                show_profile(port, self.place, self.plugin, self.bank, recording, worst)
            largest["tick"] = max(largest["tick"], ticks[worst]["instructions"])
            if recording.name != "hostile" and self.by_hand:
                largest["tick-3-contacts"] = max(largest["tick-3-contacts"], most(ticks, few))
            largest["stack"] = max(largest["stack"], stack)
        check_bound(port, self.bound, largest["tick"], self.name)
        check_work(port, self.place, self.plugin, self.bank, next(r for r in self.recordings if r.name == "jumps"), self.name)
        return largest


TICK_CHECKS = 8


def check_ticks(port, scenes):
    largest = {}
    for scene in scenes:
        for name, figure in scene.measure(port).items():
            largest[name] = max(largest.get(name, 0), figure)
    scene = scenes[0]
    first, again = (count_ticks(port, scene.place, scene.plugin, scene.bank, scene.recordings[-1])[0] for _ in range(2))
    result(first == again and len(first) > 1000,
           "%s: two runs of a recording take the same instructions, tick by tick" % port.title)
    check(port, "stack", max(largest.pop("stack"), measured[port.name, "stack"]))
    for name, figure in largest.items():
        check(port, name, figure)


def broad(place):
    """The demo with a tool as broad as the format lets it be: sixteen points on triangles of their own, which take all slots
    of the row cache. The solver's steps are limited so that a tick's bound can be kept at all."""
    text = pathlib.Path("host/scenes/demo/demo.yaml").read_text()
    for old, new in [("tip: {radius: 5 mm, points: 7}", "tip: {radius: 20 mm, points: 16}"), ("{steps: 24}", "{steps: 6}"),
                     ("budget: {instructions: 240000,", "budget: {instructions: 480000,")]:
        if old not in text:
            raise RuntimeError("the demo's scene no longer says " + old)
        text = text.replace(old, new)
    (place / "liver.geo").write_text(pathlib.Path("host/scenes/demo/liver.geo").read_text())
    (place / "broad.yaml").write_text(text)
    return place / "broad.yaml"


def skip_port(port, checks, why):
    for _ in range(1 if TABLE else checks):
        result(False, port.title, skip=why)


def show_table():
    say()
    say("%-16s %-18s %9s %9s" % ("port", "figure", "measured", "at most"))
    for (port, name), (limit, what) in budgets().items():
        figure = measured.get((port, name))
        say("%-16s %-18s %9s %9d  %s" % (port, name, "-" if figure is None else figure, limit, what))


def main():
    ports = emulated.PORTS + emulated.COMPILED
    if not TABLE:
        print("1..%d" % (IMAGE_CHECKS * len(ports) + TICK_CHECKS * len(emulated.PORTS)))
    built = [port for port in ports if not port.missing_compiler()]
    for port in ports:
        if port in built:
            check_image(port)
        else:
            skip_port(port, IMAGE_CHECKS, port.missing_compiler())
    with tempfile.TemporaryDirectory(prefix="trocar-budgets-") as place:
        place = pathlib.Path(place)
        plugin = emulated.build_plugin(place)
        scenes = [Scene(place, plugin, "host/scenes/demo/demo.yaml"),
                  Scene(place, plugin, broad(place), recordings=HOSTILE)]
        if TABLE and LIVER.exists():
            scenes.append(Scene(place, plugin, LIVER, "--extent", "0.214"))
        elif TABLE:
            say("%s is not here: the demo alone" % LIVER.name)
        for port in emulated.PORTS:
            if port.missing():
                skip_port(port, TICK_CHECKS, port.missing())
            else:
                check_ticks(port, scenes)
    if TABLE:
        show_table()
    return 1 if failed else 0


sys.exit(main())
