#!/usr/bin/env python3
# not sanitised: it compiles images of the controller by itself
"""An effect that a scene does not name is not there: no file of it is needed, no symbol is in the image, and every instruction
is the same as if it had never been written."""

import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

EFFECT = re.compile(r'^EFFECT\((\d+), *([A-Z_]+), *([a-z_]+), *\w+, *"([^"]*)"', re.MULTILINE)
TABLE = EFFECT.findall(pathlib.Path("shared/effects.def").read_text())
ENVIRONMENT = {key: value for key, value in os.environ.items() if key not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS", "B")}
PORTS = [("blank", "")] + ([("cortex_m7_an500", "arm-none-eabi-")] if shutil.which("arm-none-eabi-gcc") else [])

count = 0
failed = False


def result(good, claim, note=""):
    global count, failed
    count += 1
    failed = failed or not good
    print("%sok %d - %s" % ("" if good else "not ", count, claim))
    if note and not good:
        print("# " + str(note)[:2000].replace("\n", "\n# "))
    sys.stdout.flush()


def make(tree, *words):
    done = subprocess.run(["make", "--no-print-directory", *words], cwd=tree, env=ENVIRONMENT, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def copy(place, name):
    tree = place / name
    for part in ("Makefile", "firmware", "shared", "host/dependencies.sh"):
        source = pathlib.Path(part)
        (tree / source).parent.mkdir(parents=True, exist_ok=True)
        (shutil.copytree if source.is_dir() else shutil.copy2)(source, tree / source)
    return tree


def image(tree, port, effects, name):
    status, said = make(tree, "image", "PORT=" + port, "IMAGE=" + name, "EFFECTS=" + " ".join(effects))
    return tree / "build/firmware" / port / name / "controller.elf", status, said


def code(elf, prefix):
    """The machine's instructions and constants, without debugging information and paths."""
    text = subprocess.run([prefix + "objdump", "-d", "--no-show-raw-insn", elf], capture_output=True, text=True, check=True).stdout
    return text.split("\n", 3)[3]


def symbols(elf, prefix):
    return {line.split()[-1] for line in subprocess.run([prefix + "nm", elf], capture_output=True, text=True,
                                                        check=True).stdout.splitlines()}


def remove(tree, names):
    """The files of effects, and of parts that only they use."""
    kept = {part for _, _, name, parts in TABLE if name not in names for part in parts.split()}
    for _, _, name, parts in TABLE:
        if name in names:
            for file in [name] + [part for part in parts.split() if part not in kept]:
                for suffix in (".c", ".h"):
                    (tree / "firmware/effects" / (file + suffix)).unlink(missing_ok=True)


def main():
    print("1..%d" % (2 * len(PORTS) + 2 * len(TABLE) + 1))
    result(len({bit for bit, *_ in TABLE}) == len(TABLE) and len(TABLE) > 0, "every effect has a bit of its own")
    with tempfile.TemporaryDirectory() as folder:
        place = pathlib.Path(folder)
        whole, bare = copy(place, "whole"), copy(place, "bare")
        remove(bare, [name for _, _, name, _ in TABLE])
        own = {port: symbols(image(whole, port, [], "base")[0], prefix) for port, prefix in PORTS}
        for port, prefix in PORTS:
            base, status, said = image(whole, port, [], "base")
            without, status_without, said_without = image(bare, port, [], "base")
            result(status == 0 and status_without == 0, "%s: the base image builds without the files of any effect" % port,
                   said + said_without)
            result(code(base, prefix) == code(without, prefix), "%s: and is the same to the last instruction" % port)
        for _, _, name, parts in TABLE:
            tree = copy(place, "without_" + name)
            remove(tree, [name])
            others = [other for _, _, other, other_parts in TABLE if other != name]
            for port, prefix in PORTS[:1]:
                lean, status, said = image(tree, port, others, "others")
                result(status == 0, "%s: the image of every other effect builds without the files of %s" % (port, name), said)
                full, status, said = image(whole, port, [name], name)
                added = symbols(full, prefix) - own[port] if status == 0 else set()
                marked = {symbol for symbol in added if symbol.startswith(name + "_")}
                result(status == 0 and marked and not marked & own[port] and not marked & symbols(lean, prefix),
                       "%s: the functions of %s are in its own image and in no other" % (port, name), said)
    return 1 if failed else 0


sys.exit(main())
