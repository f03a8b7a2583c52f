#!/usr/bin/env python3
# not sanitised: it compiles the controller by itself
"""The controller needs nothing but a C compiler.

For this machine and, where a cross compiler is installed, for a Cortex-M7 with a single-precision FPU: every file of
firmware/ and shared/ compiles freestanding; all of it links with nothing but the blank port, which has the functions of
hal.h and the four memory functions that a compiler may call; no symbol stays undefined. On the Cortex-M7 double
arithmetic would need helper functions that are not there, so the link also proves single precision. From the compiler's call graph:
no recursion, no call through a pointer, no stack of unknown size.

Sizes and stack are printed as comments.
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from call_graph import call_graph, deepest

FLAGS = ("-std=c11 -O2 -ffreestanding -fno-builtin -nostdlib -ffp-contract=off -fno-math-errno -fno-strict-aliasing "
         "-Wall -Wextra -Wdouble-promotion -Werror -fstack-usage -fcallgraph-info=su -ffunction-sections -fdata-sections "
         "-Ishared -Ifirmware").split()
TARGETS = [  # name, prefix of the tools, flags
    ("this machine", "", ["-fno-stack-protector", "-fno-asynchronous-unwind-tables"]),
    ("Cortex-M7", "arm-none-eabi-", "-mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-sp-d16".split()),
]
MEMORY = {"memcpy", "memset", "memmove", "memcmp"}
PORT = pathlib.Path("firmware/ports/blank")
ENTRY = "blank_main"
STRUCTS = [("controller", "tick.h"), ("node", "node.h"), ("bank_view", "bank_view.h")]
TESTS_PER_TARGET = 6

os.environ["CCACHE_DISABLE"] = "1"  # a cache of the compiler's output does not keep the call graph
count = 0
failed = False


def result(good, claim, notes=(), skip=None):
    global count, failed
    count += 1
    failed = failed or not (good or skip)
    print("%sok %d - %s%s" % ("" if good or skip else "not ", count, claim, " # SKIP " + skip if skip else ""))
    for note in notes:
        print("# " + note)
    sys.stdout.flush()


def call(*command):
    done = subprocess.run([str(word) for word in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    return done.returncode, done.stdout


def check(name, prefix, flags, folder):
    cc = prefix + "gcc"
    if not shutil.which(cc):
        for claim in range(TESTS_PER_TARGET):
            result(False, "%s, check %d" % (name, claim + 1), skip="%s is not installed" % cc)
        return
    sources = sorted(path for place in ("firmware", "firmware/effects", "firmware/drivers", "shared") for path in pathlib.Path(place).glob("*.c"))
    objects, faults = [], []
    for source in sources:
        target = folder / (str(source).replace("/", "_")[:-2] + ".o")
        status, said = call(cc, *FLAGS, *flags, "-c", source, "-o", target)
        if status:
            faults += said.splitlines()
        else:
            objects.append(target)
    result(not faults and objects, "%s: every file of the controller compiles freestanding (%d files)" % (name, len(sources)),
           faults)

    surroundings = []
    for source in sorted(PORT.glob("*.c")):
        target = folder / ("port_" + source.stem + ".o")
        # The memory functions must not be turned into calls of themselves.
        status, said = call(cc, *FLAGS, *flags, "-fno-tree-loop-distribute-patterns", "-c", source, "-o", target)
        faults += said.splitlines() if status else []
        surroundings.append(target)
    image = folder / "image.elf"
    status, said = call(cc, *flags, "-nostdlib", "-static", "-Wl,-e," + ENTRY, "-Wl,--no-undefined", "-Wl,--fatal-warnings", *objects,
                        *surroundings, "-o", image)
    missing = sorted(set(re.findall(r"undefined reference to `([^']*)'", said)))
    result(status == 0 and not faults, "%s: it links with the blank port and no library" % name,
           faults + ["undefined: " + symbol for symbol in missing] + ([] if missing or not status else said.splitlines()))

    undefined, defined = set(), set()
    for target in objects:
        for line in call(prefix + "nm", target)[1].splitlines():
            kind, symbol = line.split()[-2:]
            (undefined if kind in "Uvw" else defined).add(symbol)
    outside = undefined - defined
    left = [line.split()[-1] for line in call(prefix + "nm", "-u", image)[1].splitlines()] if status == 0 else ["no image"]
    hal = set(re.findall(r"^[\w ]+?[ *](hal_\w+)\(", pathlib.Path("firmware/hal.h").read_text(), re.MULTILINE))
    result(outside <= MEMORY | hal and not left, "%s: nothing comes from outside but hal.h and the memory functions" % name,
           ["wanted from outside: " + (", ".join(sorted(outside)) or "nothing")]
           + ["undefined in the image: " + symbol for symbol in left])

    single = []
    for target in objects:
        function = "?"
        for line in call(prefix + "objdump", "-d", "--no-show-raw-insn", target)[1].splitlines():
            named = re.match(r"[0-9a-f]+ <(.*)>:", line)
            function = named[1] if named else function
            if re.search(r"\t(v?(cvt\w*(sd|pd)\w*|(add|sub|mul|div|sqrt|ucomi|comi|min|max)(sd|pd))|f(ld|st|add|mul)\w*)\s|"
                         r"\tv\w+\.(f64\S*|\w+\.f64)\s", line):
                single.append("%s: %s: %s" % (target.name, function, line.split("\t", 1)[1].replace("\t", " ")))
    result(not single, "%s: no instruction computes in double precision" % name, single)

    frame, dynamic, calls = call_graph([target.with_suffix(".ci") for target in objects])
    total, cycles = deepest(frame, calls)
    indirect = sorted(source for source, targets in calls.items() if "__indirect_call" in targets)
    result(not cycles and not indirect, "%s: no recursion, no call through a pointer" % name,
           ["recursion: " + cycle for cycle in cycles] + ["call through a pointer in " + source for source in indirect])
    short = lambda function: function.split(":")[-1]
    worst = max(frame.items(), key=lambda item: item[1], default=("none", 0))
    result(not dynamic and frame, "%s: every stack frame has a known size" % name, ["unbounded: " + f for f in sorted(dynamic)])

    print("# %s: largest frame %d bytes (%s)" % (name, worst[1], short(worst[0])))
    print("# %s: deepest stack %d bytes (%s)" % (name, total[0], " > ".join(map(short, total[1]))))
    text = data = bss = 0
    for line in call(prefix + "size", *objects)[1].splitlines()[1:]:
        text, data, bss = (a + int(b) for a, b in zip((text, data, bss), line.split()[:3]))
    print("# %s: controller text %d, data %d, bss %d bytes" % (name, text, data, bss))
    for struct, header in STRUCTS:
        probe = folder / "probe.c"
        probe.write_text('#include "%s"\nextern char probe[];\nchar probe[sizeof(struct %s)];\n' % (header, struct))
        status, said = call(cc, *FLAGS, *flags, "-c", probe, "-o", folder / "probe.o")
        sizes = re.findall(r"^\S+ (\S+) \w probe$", call(prefix + "nm", "-S", folder / "probe.o")[1], re.MULTILINE)
        print("# %s: struct %s %s bytes" % (name, struct, int(sizes[0], 16) if sizes else "unknown"))


def main():
    print("1..%d" % (TESTS_PER_TARGET * len(TARGETS)))
    for name, prefix, flags in TARGETS:
        with tempfile.TemporaryDirectory() as folder:
            check(name, prefix, flags, pathlib.Path(folder))
    return 1 if failed else 0


sys.exit(main())
