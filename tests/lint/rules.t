#!/usr/bin/env python3
"""Rules of the tree that no compiler checks."""

import os
import pathlib
import re
import subprocess
import sys

import c_text

TOP = {"Makefile", "README.md", "LICENSE", "CHANGELOG.md", "firmware", "host", "shared", "sim", "tests"}
TEXT = (".c", ".h", ".S", ".def", ".dbc", ".md", ".sh", ".t", ".py", ".js", ".html", ".css", ".yaml", ".mk", "")
# Spelled so that this file does not contain them.
UNFINISHED = re.compile(r"\b(TO" r"DO|FIX" r"ME|XX" r"X)\b")
MACHINE_PATH = re.compile(r"(?<![\w.$}/*-])/(home|root|work|farm|Users|mnt|media)/\w")


def tracked():
    listed = subprocess.run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
                            stdout=subprocess.PIPE, check=True).stdout.decode()
    return sorted(pathlib.Path(name) for name in listed.split("\0") if name and os.path.exists(name))


def search(files, pattern, what, text_of=lambda source: source):
    faults = []
    for path in files:
        for number, line in enumerate(text_of(path.read_text(errors="replace")).split("\n"), 1):
            if pattern.search(line):
                faults.append("%s:%d: %s" % (path, number, what))
    return faults


def main():
    files = tracked()
    text = [path for path in files if path.suffix in TEXT and path.name != "LICENSE"]
    controller = [path for path in files if path.suffix in (".c", ".h") and "ports" not in path.parts
                  and path.parts[0] in ("firmware", "shared")]
    results = []

    def check(claim, faults):
        results.append(c_text.report(len(results) + 1, claim, faults))

    print("1..8")
    check("the top of the tree has only what the layout names",
          ["%s does not belong here" % name for name in sorted({path.parts[0] for path in files})
           if name not in TOP and not name.startswith(".")])
    check("no double in the controller",
          search(controller, re.compile(r"\bdouble\b|\b\d+\.\d*(e[+-]?\d+)?(?![\w.])|\b\d+e[+-]?\d+(?![\w.])|(?<![\w.])\.\d+(?![\w.])"),
                 "a double, or a constant without f", c_text.code))
    check("the controller includes only freestanding headers and its own",
          search(controller, re.compile(r"#\s*include\s*<(?!(stdint|stddef|stdbool|float|limits|stdalign|stdnoreturn)\.h>)"),
                 "not a freestanding header"))
    check("nothing is marked as unfinished", search(text, UNFINISHED, "unfinished"))
    check("no path of a particular machine", search(text, MACHINE_PATH, "a path of one machine"))
    check("scripts with an interpreter line are executable, others are not",
          ["%s: mode does not fit" % path for path in files if path.is_file() and not path.is_symlink()
           and (path.open("rb").read(2) == b"#!") != os.access(path, os.X_OK)]
          + ["%s: is not executable" % path for path in files if path.suffix == ".t" and not os.access(path, os.X_OK)])
    check("no file of code is longer than 500 lines: one idea each",
          ["%s: %d lines" % (path, count) for path in files
           if path.suffix in (".c", ".h") and path.parts[0] in ("firmware", "host", "shared", "sim")
           for count in [path.read_bytes().count(b"\n")] if count > 500])
    check("every header says what it is, and has a guard",
          ["%s: no opening comment or no guard" % path for path in files if path.suffix == ".h"
           and not re.match(r"/\*.*?\*/\s*(#ifndef \w+\s*#define \w+|#pragma once)", path.read_text(errors="replace"),
                            re.DOTALL)])
    return 0 if all(results) else 1


sys.exit(main())
