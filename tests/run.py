#!/usr/bin/env python3
"""Run the tests and count their results.

run.py [--build DIR] [--sanitised DIR:GROUP,GROUP...] [--jobs N] [WORD...]

A test is a program build/tests/GROUP/test_*, or an executable script tests/GROUP/*.t; it runs from the checkout's root
with its build directory in $B and prints TAP. Those of the named groups run a second time from the sanitised build; a
script with a line `# not sanitised: reason` does not. With WORDs, only tests whose path contains one of them run.

A test that prints no plan, or another number of results than planned, or ends with an error although all its results
are good, counts as one more failure; so does one that takes longer than TEST_SECONDS (default 600). The last line is
`N passed, N failed, N skipped`. Outputs are kept in build/tests/log.
"""

import argparse
import collections
import concurrent.futures
import os
import pathlib
import re
import signal
import subprocess
import sys
import threading
import time

RESULT = re.compile(r"(not )?ok\b\s*\d*\s*(?:- )?([^#]*)(?:#\s*(skip|todo)\S*\s*(.*))?", re.IGNORECASE)
PLAN = re.compile(r"1\.\.(\d+)\s*(?:#\s*skip\S*\s*(.*))?$", re.IGNORECASE)

Test = collections.namedtuple("Test", "name command build")


class Outcome:
    def __init__(self, test):
        self.test = test
        self.passed = 0
        self.failures = []  # descriptions
        self.skips = []     # "what: why"
        self.seconds = 0.0
        self.output = ""


def read_tap(text, outcome):
    """Count the results of a TAP stream. Several plans in a row are allowed: one per group of a program."""
    planned, seen, skipped_whole = None, 0, False
    for line in text.splitlines():
        plan = PLAN.match(line)
        if plan:
            planned = (planned or 0) + int(plan[1])
            if plan[1] == "0":
                skipped_whole = True
                outcome.skips.append("all: " + (plan[2] or "no reason given"))
            continue
        result = RESULT.match(line)
        if not result:
            if line.startswith("Bail out!"):
                outcome.failures.append(line)
            continue
        seen += 1
        bad, what, directive, why = result[1], result[2].strip(), (result[3] or "").lower(), result[4]
        if directive == "skip":  # also "not ok 2 # SKIP name", which is how cmocka says it
            outcome.skips.append(": ".join(filter(None, (what, why))))
        elif bad and directive != "todo":
            outcome.failures.append(what or "result %d" % seen)
        else:
            outcome.passed += 1
    if planned is None:
        outcome.failures.append("printed no plan (%d results)" % seen)
    elif planned != seen and not (skipped_whole and planned == 0):
        outcome.failures.append("planned %d results, printed %d" % (planned, seen))


def end_group(process):
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass


running = set()
running_lock = threading.Lock()


def run(test, log_folder, seconds):
    outcome = Outcome(test)
    environment = dict(os.environ, B=test.build, LC_ALL="C.UTF-8", PYTHONDONTWRITEBYTECODE="1")
    environment.setdefault("OPENBLAS_NUM_THREADS", "1")  # tests already run side by side
    environment.setdefault("UBSAN_OPTIONS", "print_stacktrace=1:halt_on_error=1")
    log = log_folder / (re.sub(r"[^\w.-]+", "_", test.name) + ".log")
    begin = time.monotonic()
    with open(log, "w+b") as out:
        try:
            process = subprocess.Popen(test.command, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT,
                                       env=environment, start_new_session=True)
        except OSError as error:
            outcome.failures.append("does not start: %s" % error)
            return outcome
        with running_lock:
            running.add(process)
        try:
            status = process.wait(seconds)
        except subprocess.TimeoutExpired:
            status = None
        end_group(process)  # whatever it left behind
        process.wait()
        with running_lock:
            running.discard(process)
        outcome.seconds = time.monotonic() - begin
        out.seek(0)
        outcome.output = out.read().decode(errors="replace")
    read_tap(outcome.output, outcome)
    if status is None:
        outcome.failures.append("took longer than %d s" % seconds)
    elif status != 0 and not outcome.failures:
        outcome.failures.append("ended with %s" % ("signal %d" % -status if status < 0 else "status %d" % status))
    return outcome


def find(build, groups=None, sanitised=False):
    tests = []
    for source in sorted(pathlib.Path("tests").glob("*/*")):
        if groups is not None and source.parent.name not in groups:
            continue
        suffix = " (sanitised)" if sanitised else ""
        if source.name.startswith("test_") and source.suffix == ".c":
            program = pathlib.Path(build) / source.with_suffix("")
            tests.append(Test(str(source.with_suffix("")) + suffix, [str(program)], build))
        elif source.suffix == ".t":
            if sanitised and re.search(r"^# not sanitised: ", source.read_text(errors="replace"), re.MULTILINE):
                continue
            tests.append(Test(str(source) + suffix, ["./" + str(source)], build))
    return tests


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default="build")
    parser.add_argument("--sanitised", metavar="DIR:GROUPS")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("word", nargs="*")
    options = parser.parse_args()
    os.chdir(pathlib.Path(__file__).resolve().parent.parent)

    tests = find(options.build)
    if options.sanitised:
        build, groups = options.sanitised.split(":")
        tests += find(build, groups.split(","), sanitised=True)
    if options.word:
        tests = [test for test in tests if any(word in test.name for word in options.word)]
    if not tests:
        print("no test matches")
        print("0 passed, 1 failed, 0 skipped")
        return 1

    # The slowest of the last run first, so that the last one to end is short; unknown ones count as slow.
    log_folder = pathlib.Path(options.build) / "tests" / "log"
    log_folder.mkdir(parents=True, exist_ok=True)
    times_file = log_folder / "seconds"
    times = {}
    if times_file.exists():
        for line in times_file.read_text().splitlines():
            seconds, _, name = line.partition(" ")
            times[name] = float(seconds)
    tests.sort(key=lambda test: -times.get(test.name, 1e9))

    limit = float(os.environ.get("TEST_SECONDS", "600"))
    begin = time.monotonic()
    outcomes = []
    pool = concurrent.futures.ThreadPoolExecutor(options.jobs)
    try:
        futures = [pool.submit(run, test, log_folder, limit) for test in tests]
        for future in concurrent.futures.as_completed(futures):
            outcome = future.result()
            outcomes.append(outcome)
            times[outcome.test.name] = outcome.seconds
            word = "FAIL" if outcome.failures else "ok"
            counts = "%d passed" % outcome.passed
            counts += ", %d failed" % len(outcome.failures) if outcome.failures else ""
            counts += ", %d skipped" % len(outcome.skips) if outcome.skips else ""
            print("%-4s %7.1f s  %s  %s" % (word, outcome.seconds, outcome.test.name, counts), flush=True)
            if outcome.failures:
                print("".join("     | %s\n" % line for line in outcome.output.splitlines()[-200:]), end="", flush=True)
    except KeyboardInterrupt:
        pool.shutdown(wait=False, cancel_futures=True)
        with running_lock:
            for process in running:
                end_group(process)
        print("interrupted")
        return 130
    times_file.write_text("".join("%.2f %s\n" % (times[name], name) for name in sorted(times)))

    for outcome in outcomes:
        for skip in outcome.skips:
            print("skipped: %s: %s" % (outcome.test.name, skip))
    for outcome in outcomes:
        for failure in outcome.failures:
            print("failed: %s: %s" % (outcome.test.name, failure))
    passed = sum(outcome.passed for outcome in outcomes)
    failed = sum(len(outcome.failures) for outcome in outcomes)
    skipped = sum(len(outcome.skips) for outcome in outcomes)
    print("%d tests in %.0f s" % (len(tests), time.monotonic() - begin))
    print("%d passed, %d failed, %d skipped" % (passed, failed, skipped))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
