#!/usr/bin/env python3
"""The checkers themselves: the runner and the rules see every fault that is planted, and no other."""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

import c_text

ROOT = pathlib.Path.cwd()
SCRIPTS = {  # name: script, and what the runner must count: passed, failed, skipped
    "good": ("echo 1..2; echo ok 1 - a; echo ok 2 - b", (2, 0, 0)),
    "bad": ("echo 1..2; echo ok 1 - a; echo not ok 2 - b; exit 1", (1, 1, 0)),
    "no_plan": ("echo ok 1 - a", (1, 1, 0)),
    "silent": ("exit 0", (0, 1, 0)),
    "short": ("echo 1..3; echo ok 1 - a", (1, 1, 0)),
    "long": ("echo 1..1; echo ok 1 - a; echo ok 2 - b", (2, 1, 0)),
    "dies": ("echo 1..1; echo ok 1 - a; kill -SEGV $$", (1, 1, 0)),
    "status": ("echo 1..1; echo ok 1 - a; exit 3", (1, 1, 0)),
    "hangs": ("echo 1..1; echo ok 1 - a; exec sleep 1000", (1, 1, 0)),
    "skips": ("echo 1..2; echo 'ok 1 - a # SKIP no such device'; echo 'not ok 2 # SKIP b'", (0, 0, 2)),
    "skips_all": ("echo '1..0 # SKIP no network'", (0, 0, 1)),
    "two_groups": ("echo 1..1; echo ok 1 - a; echo 1..1; echo not ok 1 - b; exit 1", (1, 1, 0)),
    "bails": ("echo 1..1; echo ok 1 - a; echo 'Bail out! the bus is gone'", (1, 1, 0)),
}


def run_tests(folder, scripts, word=None):
    tests = folder / "tests"
    shutil.rmtree(tests, ignore_errors=True)
    (tests / "planted").mkdir(parents=True)
    shutil.copy(ROOT / "tests/run.py", tests / "run.py")
    for name, script in scripts.items():
        path = tests / "planted" / (name + ".t")
        path.write_text("#!/bin/sh\n%s\n" % script)
        path.chmod(0o755)
    done = subprocess.run([sys.executable, str(tests / "run.py")] + ([word] if word else []), stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, env=dict(os.environ, TEST_SECONDS="5"))
    return done.returncode, done.stdout.splitlines()


def runner(folder):
    faults = []
    for name, (script, counts) in SCRIPTS.items():
        status, lines = run_tests(folder, {name: script})
        if lines[-1:] != ["%d passed, %d failed, %d skipped" % counts] or (status != 0) != (counts[1] > 0):
            faults.append("%s: status %d, %s" % (name, status, lines[-1:]))
    status, lines = run_tests(folder, {name: script for name, (script, _) in SCRIPTS.items()})
    total = tuple(sum(column) for column in zip(*(counts for _, counts in SCRIPTS.values())))
    if lines[-1:] != ["%d passed, %d failed, %d skipped" % total] or status == 0:
        faults.append("all together: status %d, %s" % (status, lines[-1:]))
    status, lines = run_tests(folder, {"good": "echo 1..1; echo ok"}, "nonesuch")
    if status == 0:
        faults.append("a word that matches nothing passes")
    return faults


def lint(folder, script, path, text):
    """Status of a lint script in a small checkout with one file more."""
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "tests/lint").mkdir(parents=True)
    (folder / "firmware").mkdir()
    for name in (script, "c_text.py"):
        shutil.copy(ROOT / "tests/lint" / name, folder / "tests/lint" / name)
    subprocess.run(["git", "init", "-q", str(folder)], check=True)
    if path:
        planted = folder / path
        planted.parent.mkdir(parents=True, exist_ok=True)
        planted.write_text(text)
    return subprocess.run(["tests/lint/" + script], cwd=folder, stdout=subprocess.DEVNULL).returncode


def planted(folder, script, bad, good):
    faults = []
    for path, text in good:
        if lint(folder, script, path, text) != 0:
            faults.append("%s: refused although right: %s: %r" % (script, path, text))
    for path, text in bad:
        if lint(folder, script, path, text) == 0:
            faults.append("%s: not seen: %s: %r" % (script, path, text))
    return faults


def main():
    results = []
    print("1..3")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        results.append(c_text.report(1, "the runner counts every way in which a test can end", runner(folder / "runner")))
        results.append(c_text.report(2, "a loop without its bound is seen, however it is written", planted(
            folder / "bounds", "bounds.t",
            bad=[("firmware/a.c", text) for text in (
                "void f(int n) { for (int i = 0; i < n; i++) g(i); }\n",
                "void f(void) { while (g()) h(); } /* unbounded */\n",
                "void f(void)\n{\n    do {\n        g();\n    } while (h());\n}\n",
                "void f(void) { again: if (g()) goto again; }\n",
                "void f(void) { puts(\"bound: 3\"); for (;;) g(); }\n",
                "/* bound: 3 */\nint x;\nvoid f(void) { for (;;) g(); }\n")],
            good=[(None, None)] + [("firmware/a.c", text) for text in (
                "void f(int n) { for (int i = 0; i < n; i++) /* bound: n */ g(i); }\n",
                "/* bound: 3 */\nvoid f(void) { for (;;) g(); }\n",
                "void f(void)\n{\n    do { /* bound: 8 */\n        g();\n    } while (h());\n}\n",
                "void f(int n)\n{\n    for (int i = 0;\n         i < n; i++) /* bound: n */\n        g();\n}\n",
                "/* for the while, do as the bound says */ char c = 'f'; // for\n")])))
        home = "/ho" "me/someone/file"
        results.append(c_text.report(3, "a breach of the tree's rules is seen", planted(
            folder / "rules", "rules.t",
            bad=[("extra/a.c", "int a;\n"), ("firmware/a.c", "double a;\n"), ("firmware/a.c", "float a = 1.0;\n"),
                 ("firmware/a.c", "float a = 2e-3;\n"), ("firmware/a.c", "#include <stdio.h>\n"),
                 ("host/b/a.c", "/* TO" "DO: more */\n"), ("host/b/a.sh", "cat %s\n" % home),
                 ("tests/e2e/a.sh", "#!/bin/sh\n"), ("tests/e2e/a.t", "echo 1..0\n"),
                 ("host/b/a.c", "\n" * 501), ("host/b/a.h", "int a;\n")],
            good=[(None, None), ("firmware/a.c", "/* a double, 1.0 */\nfloat a = 1.0f + 2e-3f, b = 0x1p3f;\n"),
                  ("firmware/ports/native/a.c", "#include <stdio.h>\ndouble a;\n"),
                  ("host/b/a.h", "/* What. */\n#ifndef A_H\n#define A_H\n#endif\n"),
                  ("host/b/a.sh", "cat \"$place%s\" /proc/self /usr/include\n" % home)])))
    return 0 if all(results) else 1


sys.exit(main())
