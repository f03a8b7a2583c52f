#!/usr/bin/env python3
"""Every loop of the controller says its bound beside it: `bound: ...` in a comment on the loop's line or just above it.

The controller is firmware/ outside its ports, and shared/. Loops by goto and by recursion are refused here and in
tests/unit/firmware_freestanding.t.
"""

import pathlib
import re
import sys

import c_text

LOOP = re.compile(r"\b(for|while|do|goto)\b")


def unbounded(path):
    source = path.read_text()
    code, comments = c_text.code(source), c_text.comments(source).split("\n")
    lines = code.split("\n")
    depth_of_do = []  # a `while` that closes a `do` is the same loop
    for loop in LOOP.finditer(code):
        word, line = loop[1], code.count("\n", 0, loop.start())
        if word == "goto":
            yield "%s:%d: goto" % (path, line + 1)
            continue
        if word == "do":
            depth_of_do.append(code.count("{", 0, loop.start()) - code.count("}", 0, loop.start()))
        elif word == "while" and depth_of_do:
            depth = code.count("{", 0, loop.start()) - code.count("}", 0, loop.start())
            closes = re.match(r"\s*\([^;{}]*\)\s*;", code[loop.end():])
            if closes and depth == depth_of_do[-1]:
                depth_of_do.pop()
                continue
        # The loop's own line, the rest of its head when that is broken over lines, and the comment just above.
        last, opened = line, 0
        for i in range(line, min(line + 6, len(lines))):
            opened += lines[i].count("(") - lines[i].count(")")
            last = i
            if opened <= 0:
                break
        beside = " ".join(comments[line:last + 1])
        above = line - 1
        while above >= 0 and not lines[above].strip() and comments[above].strip():
            beside = comments[above] + " " + beside
            above -= 1
        if "bound:" not in beside:
            yield "%s:%d: a `%s` loop without its bound" % (path, line + 1, word)


def main():
    files = sorted(path for folder in ("firmware", "shared") for path in pathlib.Path(folder).glob("*.[ch]"))
    files += sorted(path for part in ("effects", "drivers") for path in pathlib.Path("firmware", part).glob("*.[ch]"))
    print("1..1")
    good = c_text.report(1, "every loop of the controller has a stated bound (%d files)" % len(files),
                         [fault for path in files for fault in unbounded(path)])
    return 0 if good else 1


sys.exit(main())
