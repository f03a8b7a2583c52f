"""What a test in Python says: a line of TAP for each claim, what was found below one that does not hold, and the plan at the end."""
import sys

count = failed = 0
LINES = 40  # of what was found


def check(claim, good, detail=""):
    global count, failed
    count += 1
    failed += not good
    print(f"{'ok' if good else 'not ok'} {count} - {claim}", flush=True)
    if not good and detail:
        print("\n".join("# " + line for line in str(detail).splitlines()[:LINES]), flush=True)


def skip(claim, why):
    global count
    count += 1
    print(f"ok {count} - {claim} # SKIP {why}", flush=True)


def finish():
    print(f"1..{count}")
    sys.exit(1 if failed else 0)
