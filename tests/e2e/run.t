#!/usr/bin/env python3
"""trocar run, from the outside: determinism, JSON, comparison with the full solve, and every way to refuse."""
import hashlib
import json
import os
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import zlib

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, "..")]
from block import write_block
from tap import check, finish

trocar = os.path.join(os.environ.get("B", "build"), "trocar")


def run(*arguments):
    return subprocess.run([trocar, *map(str, arguments)], capture_output=True, text=True, timeout=600)


def refuses(claim, code, part, *arguments):
    r = run(*arguments)
    line = r.stderr.strip().splitlines()[-1] if r.stderr.strip() else ""
    check(claim, r.returncode == code and part in line and line.startswith("trocar: "), f"{r.returncode}: {r.stderr}")


def soften(bank, factor):
    """The bank with its compliance scaled and every checksum made right again: wrong, but well-formed."""
    data = bytearray(bank)
    count, = struct.unpack_from("<I", data, 12)
    for k in range(count):
        at = 64 + 32 * k
        tag, offset, length = data[at:at + 4], *struct.unpack_from("<II", data, at + 8)
        if tag == b"GHLF":
            values = struct.unpack_from(f"<{length // 4}f", data, offset)
            struct.pack_into(f"<{length // 4}f", data, offset, *(factor * v for v in values))
        if tag == b"FACT":  # the compliance goes with the square of the factor's step
            step, = struct.unpack_from("<f", data, offset)
            struct.pack_into("<f", data, offset, factor ** 0.5 * step)
        if tag in (b"GHLF", b"FACT"):
            struct.pack_into("<I", data, at + 20, zlib.crc32(data[offset:offset + (length + 15) // 16 * 16]))
    struct.pack_into("<I", data, 56, zlib.crc32(data[64:64 + 32 * count]))
    struct.pack_into("<I", data, 60, zlib.crc32(data[:60]))
    return bytes(data)


def main(folder):
    path = lambda name: os.path.join(folder, name)
    write_block(path("box.msh"), (8, 6, 4), (0.2, 0.15, 0.1))
    r = run("build", path("box.msh"), "--extent", "0.2", "-o", path("box.bank"))
    check("a bank is built from a block", r.returncode == 0, r.stderr)
    scene = r.stdout[r.stdout.find("scene:"):]
    with open(path("box.yaml"), "w") as out:
        out.write("\n".join(line for line in scene.splitlines()
                            if re.match(r"(scene|body|instruments|contact|effects):| ", line)) + "\n")

    logs, results = [], []
    for n in range(2):
        r = run("run", path("box.bank"), "--gesture", "tour", "--ticks", 3000, "--json", "--torque-log", path(f"{n}.log"))
        check(f"run {n + 1} succeeds with one line of JSON", r.returncode == 0 and r.stdout.count("\n") == 1, r.stderr)
        results.append(json.loads(r.stdout))
        logs.append(open(path(f"{n}.log"), "rb").read())
    check("two runs give the same torque log, byte for byte", logs[0] == logs[1] and logs[0].count(b"\n") == 3000)
    check("the hash is that of the log's bytes",
          all(x["torque_log_sha256"] == hashlib.sha256(logs[0]).hexdigest() for x in results))
    check("the log is candump's format", all(re.fullmatch(rb"\(\d{10}\.\d{6}\) soft 201#[0-9A-F]{16}", line)
                                             for line in logs[0].splitlines()))
    j = results[0]
    print(f"# peak {j['peak_force_N']:.3f} N, {j['max_contacts']} contacts, against full FE {j['force_error_vs_fem']:.2g}"
          f" over {j['fem_compared']} ticks, bus {100 * j['bus_load']:.0f} %")
    check("no tick is missed, the loop ends in RUN", (j["ticks"], j["missed"], j["state"]) == (3000, 0, "RUN"), j)
    check("the tool is felt", j["peak_force_N"] > 0.05 and j["max_contacts"] >= 1, j)
    # What the compression costs at most was measured when the bank was built.
    stated = json.loads(run("info", path("box.bank"), "--json").stdout)["provenance"]["force_error_max"]
    check("the force on a compressed bank is that of a full finite-element solve within the bank's stated error",
          j["fem_compared"] >= 8 and 0 < j["force_error_vs_fem"] < stated, f"{stated} {j}")
    # The tick computes in single precision: 1e-4 is what the design promises against a full solve in double.
    r = run("build", path("box.msh"), "--extent", "0.2", "--plain", "-o", path("plain.bank"))
    plain = json.loads(run("run", path("plain.bank"), "--gesture", "tour", "--ticks", 3000, "--json").stdout)
    print(f"# plain bank against full FE {plain['force_error_vs_fem']:.2g}, compressed {j['force_error_vs_fem']:.2g}")
    check("the force on a plain bank is that of a full finite-element solve to 1e-4",
          plain["fem_compared"] >= 8 and 0 < plain["force_error_vs_fem"] < 1e-4, plain)

    # A bank that is wrong by 2 % must show: the tissue carries nearly all of the depth, the coupling (k) the rest.
    with open(path("box.bank"), "rb") as f:
        whole = f.read()
    with open(path("soft.bank"), "wb") as f:
        f.write(soften(whole, 1.02))
    r = run("run", path("soft.bank"), "--gesture", "tour", "--ticks", 3000, "--json")
    error = json.loads(r.stdout)["force_error_vs_fem"]
    check("the comparison sees a compliance that is wrong by 2 %", 0.01 < error < 0.02, f"{error} {r.stderr}")

    short = ("--gesture", "poke", "--ticks", 700, "--json", "--no-fem")
    r = run("run", path("box.bank"), *short)
    for how in (("--realtime",), ("--view", "--port", 0)):
        t = run("run", path("box.bank"), *short, *how)
        check(f"{how[0]} gives the same torques as simulated time", t.returncode == 0 and
              json.loads(t.stdout)["torque_log_sha256"] == json.loads(r.stdout)["torque_log_sha256"], t.stderr)
    endless = subprocess.Popen([trocar, "run", path("box.bank"), "--view", "--port", "0", "--ticks", "1000000",
                                "--torque-log", path("cut.log")], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    line = endless.stderr.readline()
    check("the page's address is printed", re.search(r"http://127\.0\.0\.1:\d+/", line), line)
    endless.send_signal(signal.SIGINT)
    out, err = endless.communicate(timeout=60)
    check("Ctrl-C ends a run with exit code 130 and no half log", endless.returncode == 130 and "INTERRUPTED" in err and
          not [f for f in os.listdir(folder) if f.startswith("cut.log")], err)

    r = run("run", path("box.bank"), "--ticks", 2000)
    check("without --json there is a table", r.returncode == 0 and "peak force" in r.stdout, r.stdout + r.stderr)
    r = run("run", path("box.bank"), "--json", "--no-fem", "--ticks", 2000)
    check("--no-fem leaves the error null", json.loads(r.stdout)["force_error_vs_fem"] is None, r.stdout)
    shutil.move(path("box.msh"), path("moved.msh"))
    r = run("run", path("box.bank"), "--json", "--ticks", 2000)
    check("without the mesh the run goes on, the error is null and a line says why",
          r.returncode == 0 and json.loads(r.stdout)["force_error_vs_fem"] is None and "box.msh" in r.stderr, r.stderr)
    shutil.move(path("moved.msh"), path("box.msh"))

    r = run("run", path("box.yaml"), "--json", "--ticks", 3000, "--gesture", "tour", "-o", path("kept.bank"))
    check("a scene is built, then run, with the same torques as its bank",
          r.returncode == 0 and json.loads(r.stdout)["torque_log_sha256"] == j["torque_log_sha256"] and
          os.path.exists(path("kept.bank")), r.stderr + r.stdout)
    r = run("run", path("box.yaml"), "--bank", path("kept.bank"), "--json", "--ticks", 3000, "--gesture", "tour")
    check("--bank spares the building", r.returncode == 0 and
          json.loads(r.stdout)["torque_log_sha256"] == j["torque_log_sha256"], r.stderr)

    r = run("run", "--print-gesture", "slide")
    with open(path("mine.gesture"), "w") as out:
        out.write(r.stdout)
    a = run("run", path("box.bank"), "--no-fem", "--json", "--gesture", path("mine.gesture"))
    b = run("run", path("box.bank"), "--no-fem", "--json", "--gesture", "slide")
    check("a printed gesture read from a file moves alike", a.returncode == 0 and
          json.loads(a.stdout)["torque_log_sha256"] == json.loads(b.stdout)["torque_log_sha256"], a.stderr)

    # Faults: repeatable, counted, and a dead device ends in SAFE with exit code 9.
    faulty = [json.loads(run("run", path("box.bank"), "--no-fem", "--json", "--faults",
                             "drop=0.02,duplicate=0.02,delay=0.02,delay_us=700", "--seed", s).stdout) for s in (3, 3, 4)]
    check("faults repeat with their seed and differ with another",
          faulty[0]["torque_log_sha256"] == faulty[1]["torque_log_sha256"] != faulty[2]["torque_log_sha256"])
    check("lost samples are counted", faulty[0]["missed"] > 0 and faulty[0]["bus_dropped"] > 0, faulty[0])
    refuses("a device that is never heard ends with exit code 9", 9, "LOOP_STALE", "run", path("box.bank"), "--no-fem",
            "--faults", "drop=1,from=0x181,to=0x181")
    r = run("run", path("box.bank"), "--no-fem", "--json", "--faults", "drop=0.6,from=0x181,to=0x181", "--ticks", 3000,
            "--seed", 2)
    check("whatever is lost, the JSON is whole", r.returncode in (0, 9) and json.loads(r.stdout)["ticks"] == 3000, r.stderr)

    with open(path("bad.gesture"), "w") as out:
        out.write("approach 1 s\npress 20 in 1 s\n")
    refuses("a gesture's error names its line", 5, "bad.gesture:2: ", "run", path("box.bank"), "--gesture",
            path("bad.gesture"))
    refuses("an unknown gesture names the known ones", 3, "press, slide, poke, hold, grasp, two_tools, two_tools-second, shape, tour", "run", path("box.bank"),
            "--gesture", "wave")
    refuses("an unknown option", 2, "--tick ", "run", path("box.bank"), "--tick s")
    refuses("an option without value", 2, "needs a value", "run", path("box.bank"), "--ticks")
    refuses("no ticks", 2, "whole number", "run", path("box.bank"), "--ticks", 0)
    refuses("negative ticks", 2, "whole number", "run", path("box.bank"), "--ticks", -5)
    refuses("a probability above one", 2, "probability", "run", path("box.bank"), "--faults", "drop=1.5")
    refuses("an unknown fault", 2, "dorp", "run", path("box.bank"), "--faults", "dorp=0.5")
    refuses("an identifier out of range", 2, "0 to 2047", "run", path("box.bank"), "--faults", "from=4096")
    refuses("no file at all", 2, "no scene or bank", "run")
    refuses("a bank that is not there", 3, "gone.bank", "run", path("gone.bank"))
    refuses("a scene that is not there", 3, "gone.yaml", "run", path("gone.yaml"))
    refuses("a mesh instead of a bank", 6, "box.msh", "run", path("box.msh"))
    refuses("a torque log that cannot be written", 3, "/nowhere/x.log", "run", path("box.bank"), "--torque-log",
            "/nowhere/x.log")
    refuses("-o with a bank", 2, "-o goes with a scene", "run", path("box.bank"), "-o", path("x.bank"))
    refuses("--hold without --view", 2, "--hold goes with --view", "run", path("box.bank"), "--hold")
    with open(path("cut.bank"), "wb") as f:
        f.write(whole[:len(whole) // 2])
    refuses("a bank cut in half", 6, "cut.bank", "run", path("cut.bank"))
    check("nothing is left behind", not [f for f in os.listdir(folder) if f.endswith(".tmp")], os.listdir(folder))


if not os.access(trocar, os.X_OK):
    print("1..0 # SKIP the program is not built")
    sys.exit(0)
with tempfile.TemporaryDirectory() as temporary:
    main(temporary)
finish()
