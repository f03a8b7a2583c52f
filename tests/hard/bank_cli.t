#!/usr/bin/env python3
"""trocar build, info and verify from outside: output, exit codes, messages, and builds that are interrupted at seeded moments
and leave neither a bank nor a temporary file. The body is a box of tetrahedra written here; with the shared data also a
liver."""
import itertools
import json
import os
import pty
import random
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import zlib

TROCAR = os.path.abspath(os.path.join(os.environ.get("B", "build"), "trocar"))
DATA = os.environ.get("TROCAR_DATA", "../shared/data")
SEED = int(os.environ.get("TROCAR_SEED", "1"))
LONG = "TROCAR_LONG" in os.environ
folder = tempfile.mkdtemp(prefix="trocar-bank-")
tests = []
results = []


def test(function):
    tests.append(function)
    return function


def run(*arguments, **more):
    return subprocess.run([TROCAR, *arguments], cwd=folder, capture_output=True, text=True, check=False, **more)


def expect(condition, what):
    if not condition:
        raise AssertionError(what)


def expect_exit(result, code, *words):
    expect(result.returncode == code, f"exit code {result.returncode} instead of {code}: {result.stderr}")
    for word in words:
        expect(word in result.stderr, f"\"{word}\" is not in: {result.stderr}")


def write_box(name, n):
    """A box of n x n x 2n cubes, six tetrahedra each, Gmsh 2.2."""
    size = (n + 1, n + 1, 2 * n + 1)
    number = lambda i, j, k: 1 + i + size[0] * (j + size[1] * k)
    elements = []
    for cell in itertools.product(range(n), range(n), range(2 * n)):
        for order in itertools.permutations(range(3)):
            at = list(cell)
            corners = [number(*at)]
            for axis in order:
                at[axis] += 1
                corners.append(number(*at))
            elements.append(corners)
    with open(os.path.join(folder, name), "w", encoding="ascii") as out:
        nodes = [(i, j, k) for k in range(size[2]) for j in range(size[1]) for i in range(size[0])]
        out.write(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{len(nodes)}\n")
        for index, node in enumerate(nodes):
            out.write("%d %d %d %d\n" % (index + 1, *node))
        out.write(f"$EndNodes\n$Elements\n{len(elements)}\n")
        for index, corners in enumerate(elements):
            out.write("%d 4 2 1 1 %d %d %d %d\n" % (index + 1, *corners))
        out.write("$EndElements\n")
    return len(nodes), len(elements)


@test
def mesh_alone_prints_the_scene_that_builds_the_same_bank():
    nodes, elements = write_box("box.msh", 3)
    first = run("build", "box.msh", "--extent", "0.1", "-o", "a.bank", "--plain", "--quiet")
    expect_exit(first, 0)
    with open(os.path.join(folder, "box.yaml"), "w", encoding="utf-8") as out:
        out.write(first.stdout)
    second = run("build", "box.yaml", "-o", "b.bank", "--plain", "--json", "--quiet")
    expect_exit(second, 0)
    report = json.loads(second.stdout)
    expect((report["nodes"], report["elements"]) == (nodes, elements), "counts")
    expect(report["surface_nodes"] == nodes - 2 * 2 * 5, "surface nodes of the box")
    expect(report["bytes"] == os.path.getsize(os.path.join(folder, "b.bank")), "bytes")
    for key in ("seconds", "peak_rss_bytes", "median_compliance_m_N"):
        expect(report[key] > 0, key)
    expect(0 < report["force_error"]["p95"] <= report["force_error"]["max"] < 2e4 * 2**-24, "force error")
    expect(report["force_error"]["reference"] and report["discretisation"], "what they are measured against")
    info = [json.loads(run("info", name, "--json").stdout) for name in ("a.bank", "b.bank")]
    for bank in info:
        # the provenance has the time that the build took; nothing else may differ
        bank.pop("bytes")
        bank["sections"] = [s for s in bank["sections"] if s["tag"] != "PROV"]
        for key in ("build_seconds",):
            bank["provenance"].pop(key)
        for section in bank["sections"]:
            section.pop("share")
    expect(info[0] == info[1], "the printed scene gives another bank")


@test
def json_keeps_stdout_for_one_object():
    result = run("build", "box.msh", "--unit", "cm", "-o", "c.bank", "--json", "--quiet")
    expect_exit(result, 0, "fixed:", "instruments:")
    json.loads(result.stdout)


@test
def info_lists_every_section():
    text = run("info", "a.bank").stdout
    for tag in ("VERT", "NORM", "TRIA", "GRID", "ROWS", "GHLF", "CONT", "TOOL", "PROV"):
        expect(f"  {tag} " in text, tag)
    sections = json.loads(run("info", "a.bank", "--json").stdout)["sections"]
    expect(abs(sum(s["share"] for s in sections) - 1) < 0.1, "shares")


@test
def verify_agrees_and_says_so():
    result = run("verify", "a.bank", "--columns", "200", "--quiet")
    expect_exit(result, 0)
    expect("0 wrong" in result.stdout, result.stdout)
    report = json.loads(run("verify", "a.bank", "--json", "--quiet").stdout)
    expect(report["agrees"] and report["structure"] and report["body_found"] and report["columns"] == 8, str(report))


def softened(name, out, tag, first, count, factor):
    """The bank with floats of a section scaled, under right checksums: of another tissue than it says."""
    with open(os.path.join(folder, name), "rb") as given:
        data = bytearray(given.read())
    table = range(64, 64 + 32 * int.from_bytes(data[12:16], "little"), 32)
    at = next(entry for entry in table if data[entry:entry + 4] == tag)
    offset, length = struct.unpack_from("<II", data, at + 8)
    values = struct.unpack_from("<%df" % count, data, offset + 4 * first)
    struct.pack_into("<%df" % count, data, offset + 4 * first, *(factor * value for value in values))
    struct.pack_into("<I", data, at + 20, zlib.crc32(data[offset:offset + (length + 15) // 16 * 16]))
    struct.pack_into("<I", data, 56, zlib.crc32(data[64:table.stop]))
    struct.pack_into("<I", data, 60, zlib.crc32(data[:60]))
    with open(os.path.join(folder, out), "wb") as made:
        made.write(data)


@test
def verify_tells_another_tissue():
    with open(os.path.join(folder, "box.yaml"), encoding="utf-8") as given:
        text = given.read()
    expect("E: 4 kPa" in text, "the assumed tissue")
    with open(os.path.join(folder, "stiff.yaml"), "w", encoding="utf-8") as out:
        out.write(text.replace("E: 4 kPa", "E: 4.01 kPa"))
    expect_exit(run("verify", "a.bank", "--scene", "stiff.yaml", "--json", "--quiet"), 12, "E: 4010 Pa", "[CHECK_FAILED]")
    softened("a.bank", "soft.bank", b"GHLF", 9, 9, 1.0025)  # between rows 1 and 0; the diagonal is looked at before
    result = run("verify", "soft.bank", "--columns", "200", "--json", "--quiet")
    expect_exit(result, 12, "direct solve", "[CHECK_FAILED]")
    expect(json.loads(result.stdout)["wrong"] > 0, "wrong entries are counted")


@test
def verify_tells_another_tissue_from_the_rounding_of_a_compressed_bank():
    expect_exit(run("build", "box.yaml", "-o", "small.bank", "--quiet"), 0)
    size = [os.path.getsize(os.path.join(folder, name)) for name in ("small.bank", "a.bank")]
    expect(size[0] < size[1] / 2, "compressed %d bytes, plain %d" % tuple(size))
    expect("FACT" in run("info", "small.bank").stdout, "the section of a compressed bank")
    expect_exit(run("verify", "small.bank", "--quiet"), 0)
    softened("small.bank", "soft.bank", b"FACT", 0, 1, 1.05)  # its step: G grows by 10 %
    expect_exit(run("verify", "soft.bank", "--quiet"), 12, "median of the diagonal", "[CHECK_FAILED]")


@test
def verify_tells_a_missing_from_a_changed_mesh():
    shutil.copy(os.path.join(folder, "box.msh"), os.path.join(folder, "gone.msh"))
    expect_exit(run("build", "gone.msh", "--extent", "0.1", "-o", "gone.bank", "--quiet"), 0)
    with open(os.path.join(folder, "gone.msh"), "a", encoding="ascii") as out:
        out.write("\n")
    expect_exit(run("verify", "gone.bank", "--quiet"), 12, "the mesh has changed", "gone.msh")
    os.remove(os.path.join(folder, "gone.msh"))
    result = run("verify", "gone.bank", "--quiet")
    expect_exit(result, 3, "not found", "gone.msh", "--scene")
    expect("structure" in result.stdout, "the structure was good all the same")


@test
def damaged_banks_end_with_exit_code_6():
    with open(os.path.join(folder, "a.bank"), "rb") as given:
        good = given.read()
    for name, damaged, words in (
            ("cut", good[:-16], ["cut short", "BANK_LENGTH"]),
            ("bit", good[:5000] + bytes([good[5000] ^ 1]) + good[5001:], ["a bit has changed", "BANK_CRC"]),
            ("new", good[:4] + b"\x09" + good[5:], ["version 9", "upgrade", "BANK_VERSION"]),
            ("text", b"$MeshFormat\n2.2 0 8\n", ["BANK_MAGIC"]),
            ("empty", b"", ["BANK_LENGTH"])):
        with open(os.path.join(folder, "bad.bank"), "wb") as out:
            out.write(damaged)
        for verb in ("info", "verify"):
            result = run(verb, "bad.bank")
            expect_exit(result, 6, *words)
            expect(result.stderr.count("\n") == 1, f"{name}: one line")


@test
def wrong_command_lines_end_with_exit_code_2():
    for arguments in (["build"], ["build", "box.msh", "--extent", "0.1"], ["build", "box.msh", "-o"],
                      ["build", "box.msh", "--extent", "-1", "-o", "x.bank"], ["build", "box.msh", "--unit", "inch", "-o", "x.bank"],
                      ["build", "box.msh", "--extent", "1", "--unit", "m", "-o", "x.bank"],
                      ["build", "box.yaml", "--extent", "1", "-o", "x.bank"], ["build", "box.msh", "b", "-o", "x.bank"],
                      ["build", "--nonsense"], ["info"], ["info", "a.bank", "b.bank"], ["info", "--x"],
                      ["verify"], ["verify", "a.bank", "--columns", "0"], ["verify", "a.bank", "--seed", "x"]):
        result = run(*arguments)
        expect_exit(result, 2, "[USAGE]")
        expect(result.stderr.count("\n") == 1, f"one line: {result.stderr}")
        expect(not os.path.exists(os.path.join(folder, "x.bank")), "a file appeared")
    for verb in ("build", "info", "verify"):
        result = run(verb, "--help")
        expect(result.returncode == 0 and result.stdout.startswith("usage: trocar " + verb), verb)


@test
def a_length_unit_is_asked_for():
    expect_exit(run("build", "box.msh", "-o", "x.bank"), 4, "--extent METRES", "[MESH_SIZE]")


@test
def what_cannot_be_written_is_refused_first():
    for place in (".", "/dev/null", "no/such/folder/x.bank"):
        expect_exit(run("build", "box.msh", "--extent", "0.1", "-o", place), 3, "[FILE_WRITE]")


@test
def output_never_costs_an_input_or_a_strangers_file():
    for arguments, out, word in ((["box.msh", "--extent", "0.1"], "box.msh", "input"), (["box.yaml"], "box.yaml", "input"),
                                 (["box.yaml"], "box.msh", "input"), (["box.msh", "--extent", "0.1"], "box.yaml", "not a bank")):
        with open(os.path.join(folder, out), "rb") as given:
            before = given.read()
        result = run("build", *arguments, "-o", out)
        expect_exit(result, 3, word, out, "[FILE_WRITE]")
        expect(result.stderr.count("\n") == 1, "one line")
        with open(os.path.join(folder, out), "rb") as given:
            expect(given.read() == before, "the file has changed")
    expect_exit(run("run", "box.yaml", "-o", "box.yaml"), 3, "input")
    expect_exit(run("build", "box.msh", "--extent", "0.1", "-o", "a.bank", "--quiet"), 0)  # an earlier bank is replaced


@test
def what_is_given_is_told_before_what_is_missing():
    expect_exit(run("build", "nofile", "-o", "x.bank"), 3, "nofile", "[FILE_OPEN]")
    expect_exit(run("build", "a.bank", "-o", "x.bank"), 4, "this is a bank, not a mesh or a scene")
    for verb in ("run", "view", "info", "verify"):
        expect_exit(run(verb, "box.msh"), 6, "trocar build box.msh --extent METRES -o box.bank")
    shutil.copy(os.path.join(folder, "box.msh"), os.path.join(folder, "it's a box.msh"))
    expect_exit(run("view", "it's a box.msh"), 6, "trocar build 'it'\\''s a box.msh' --extent METRES -o 'it'\\''s a box.bank'")
    expect_exit(run("info", "box.yaml"), 6, "trocar build box.yaml -o box.bank")


def interrupt(arguments, out, after_lines, number):
    """Build, count lines of progress on stderr, then send the signal: a moment that follows the work, not the clock."""
    before = set(os.listdir(folder))
    process = subprocess.Popen([TROCAR, *arguments, "-o", out], cwd=folder, stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True)
    for _ in range(after_lines):
        if not process.stderr.readline():
            break
    process.send_signal(number)
    message = process.stderr.read()
    process.stdout.read()
    code = process.wait()
    left = set(os.listdir(folder)) - before
    if code == 0:  # it had ended before the signal came
        expect(left == {out}, f"left behind: {left}")
        os.remove(os.path.join(folder, out))
        return False
    expect(code == 130, f"exit code {code} after line {after_lines}: {message}")
    expect("[INTERRUPTED]" in message, message)
    expect(not left, f"left behind after line {after_lines}: {left}")
    return True


@test
def interrupted_builds_leave_nothing():
    write_box("larger.msh", 8)
    draw = random.Random(SEED)
    print(f"# seed {SEED}")
    moments = [1, 2, 12, 13, 23] + [draw.randrange(1, 33) for _ in range(60 if LONG else 5)]
    stopped = 0
    for moment in moments:
        number = draw.choice([signal.SIGINT, signal.SIGTERM])
        stopped += interrupt(["build", "larger.msh", "--extent", "0.2"], "int.bank", moment, number)
    print(f"# {stopped} of {len(moments)} builds were stopped")
    expect(stopped > len(moments) // 3, "the signals came too late to show anything")


def sections(name):
    """Of a bank, by tag; without what tells how long the build took."""
    with open(os.path.join(folder, name), "rb") as given:
        data = given.read()
    found = {}
    for at in range(64, 64 + 32 * int.from_bytes(data[12:16], "little"), 32):
        tag = data[at:at + 4]
        offset, length = (int.from_bytes(data[at + k:at + k + 4], "little") for k in (8, 12))
        found[tag] = data[offset:offset + length]
    lines = [line for line in found.pop(b"PROV").split(b"\n") if b"seconds" not in line]
    return found, lines


@test
def interrupted_build_goes_on_to_the_same_bank():
    """--resume keeps the compliance; a build that is stopped behind it goes on from there."""
    arguments = ["build", "larger.msh", "--extent", "0.2", "--order", "linear"]
    part = os.path.join(folder, "part.bank.part")
    expect_exit(run(*arguments, "-o", "whole.bank", "--quiet"), 0)
    process = subprocess.Popen([TROCAR, *arguments, "--resume", "-o", "part.bank"], cwd=folder, stdout=subprocess.DEVNULL,
                               stderr=subprocess.PIPE, text=True)
    for line in process.stderr:
        if not line.startswith("compliance") and os.path.exists(part):  # the next step has begun
            break
    process.send_signal(signal.SIGINT)
    message = process.stderr.read()
    expect(process.wait() == 130, message)
    expect("part.bank.part" in message and "goes on from there" in message, message)
    expect(not os.path.exists(os.path.join(folder, "part.bank")), "a bank is there already")
    with open(part, "rb") as given:
        kept = given.read()
    again = run(*arguments, "-o", "part.bank")
    expect_exit(again, 0)
    expect("compliance" not in again.stderr, "the compliance was computed again: " + again.stderr)
    expect(sections("part.bank") == sections("whole.bank"), "another bank")
    expect(not os.path.exists(part), "the part is left")

    draw = random.Random(SEED)  # damaged, cut, or another body's: computed again, no harm
    for case in range(3):
        changed = bytearray(kept)
        if case == 0:
            changed[draw.randrange(len(changed))] ^= 1 << draw.randrange(8)
        elif case == 1:
            del changed[draw.randrange(len(changed)):]
        with open(part, "wb") as out:
            out.write(changed)
        again = run("build", "larger.msh", "--extent", "0.3" if case == 2 else "0.2", "--order", "linear", "-o", "part.bank")
        expect_exit(again, 0)
        expect("compliance" in again.stderr, f"case {case}: the part was taken")
        expect(case == 2 or sections("part.bank") == sections("whole.bank"), f"case {case}: another bank")
    with open(part, "w", encoding="ascii") as out:  # a stranger's file is left alone
        out.write("mine")
    expect_exit(run("build", "box.msh", "--extent", "0.1", "--resume", "-o", "part.bank", "--quiet"), 0)
    with open(part, encoding="ascii") as given:
        expect(given.read() == "mine", "a stranger's file was written")
    os.remove(part)


@test
def interrupted_build_keeps_the_old_bank():
    shutil.copy(os.path.join(folder, "a.bank"), os.path.join(folder, "old.bank"))
    with open(os.path.join(folder, "old.bank"), "rb") as given:
        old = given.read()
    process = subprocess.Popen([TROCAR, "build", "larger.msh", "--extent", "0.2", "-o", "old.bank"], cwd=folder,
                               stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    process.stderr.readline()
    process.kill()  # not even this leaves a temporary file
    process.stderr.read()
    process.wait()
    with open(os.path.join(folder, "old.bank"), "rb") as given:
        expect(given.read() == old, "the old bank has changed")
    if sys.platform == "linux":
        expect(not [name for name in os.listdir(folder) if name.endswith(".tmp")], "a temporary file is left")


@test
def a_terminal_sees_a_bar_with_the_time_left():
    try:
        controller, terminal = pty.openpty()
    except OSError as reason:
        return f"SKIP no pseudo-terminal here: {reason}"
    process = subprocess.Popen([TROCAR, "build", "larger.msh", "--extent", "0.2", "-o", "bar.bank"], cwd=folder,
                               stdout=subprocess.DEVNULL, stderr=terminal)
    os.close(terminal)
    shown = b""
    while True:
        try:
            piece = os.read(controller, 4096)
        except OSError:  # Linux ends a terminal without writers so
            break
        if not piece:
            break
        shown += piece
    os.close(controller)
    expect(process.wait() == 0, shown.decode())
    lines = shown.decode().replace("\r\n", "\n").split("\r")
    bars = [line for line in lines if re.search(r"\[#* *\] +\d+ % .* s left", line)]
    expect(len(bars) > 20, f"{len(bars)} states of the bar")
    for what in ("compliance", "compressing", "measuring the bank"):
        ours = [line for line in bars if line.startswith(what)]
        expect(ours and "100 %" in ours[-1], f"{what} does not end at 100 %")


@test
def liver_builds_and_agrees():
    mesh = os.path.abspath(os.path.join(DATA, "liver_smooth_1665_6691.msh"))
    if not os.path.exists(mesh):
        return f"SKIP no {mesh}; set TROCAR_DATA"
    result = run("build", mesh, "--extent", "0.214", "-o", "liver.bank", "--json", "--quiet")
    expect_exit(result, 0)
    report = json.loads(result.stdout)
    expect((report["nodes"], report["elements"], report["surface_nodes"]) == (1665, 6691, 1084), "counts")
    expect_exit(run("verify", "liver.bank", "--columns", "3", "--quiet"), 0)
    return None


print(f"1..{len(tests)}")
for index, function in enumerate(tests, 1):
    name = function.__name__.replace("_", " ")
    try:
        note = function()
        print(f"ok {index} - {name}" + (f" # {note}" if note else ""))
        results.append(True)
    except Exception as error:  # pylint: disable=broad-except
        print(f"not ok {index} - {name}")
        for line in str(error).splitlines() or [type(error).__name__]:
            print("#", line)
        results.append(False)
    sys.stdout.flush()
shutil.rmtree(folder)
sys.exit(0 if all(results) else 1)
