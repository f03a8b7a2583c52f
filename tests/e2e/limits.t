#!/usr/bin/env python3
# not sanitised: it counts on the Cortex-M7's image, which is built once
"""trocar build --max-bytes, --max-instructions, --max-force-error: the bank is within the limits and says what they cost; what
cannot be met is refused with the nearest that can, and that can. Instructions are counted in an emulated Cortex-M7.
TROCAR_LONG=1: also on the shared data's livers."""
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, "../rig"), os.path.join(HERE, "..")]
import emulated
from block import SCENE, write_block
from tap import check, finish, skip

trocar = os.path.abspath(os.path.join(os.environ.get("B", "build"), "trocar"))
DATA = pathlib.Path(os.environ.get("TROCAR_DATA", "../shared/data"))
PORT = emulated.CortexM7()


def build(source, bank, *options):
    r = subprocess.run([trocar, "build", str(source), "-o", str(bank), "--quiet", "--json", *map(str, options)],
                       capture_output=True, text=True, timeout=1800)
    return r, json.loads(r.stdout) if r.returncode == 0 else {}


def refused(r, bank):
    return r.returncode == 13 and "BANK_LIMIT" in r.stderr and not os.path.exists(bank) and not r.stdout


def allowed(r, what):
    """The number that a refusal says would do."""
    m = re.search(r"allow ([\d.e-]+) " + what, r.stderr)
    return float(m.group(1)) if m else None


def worst_counted(place, bank):
    """Instructions of the worst tick on a fast slide, and on jumps that no hand could make."""
    plugin = emulated.build_plugin(place)
    (place / "stroke").write_text("approach 0.3 s\npress 12 mm in 0.3 s\nslide 30 mm 0 mm in 0.19 s\n"
                                  "slide -30 mm 0 mm in 0.19 s\nhold 0.4 s\n")
    worst = 0
    for options in ([], ["--jumps", 700]):
        emulated.record(bank, place / "stroke", place / "answers", place / "log.csv", *options)
        ticks, _ = emulated.count_ticks(PORT, plugin, bank, place / "answers", place / "out", place / "ticks", "node_finish_tick",
                                        "node_transmit")
        worst = max(worst, max(ticks))
    return worst


def within(name, j, bank, most_bytes):
    """What holds of every bank that was built with a limit of bytes below that of the default step."""
    reached = j["limits"]["bytes"]
    check(f"{name}: a bank of at most {most_bytes} bytes is one, and uses them",
          reached["limit"] == most_bytes and j["bytes"] == reached["reached"] == os.path.getsize(bank) <= most_bytes
          and j["bytes"] > 0.96 * most_bytes, j)
    check(f"{name}: it says what the limit costs in force error",
          reached["bytes_without"] > most_bytes and reached["force_error_without"] < j["force_error"]["patch"]["p95"], j)
    print(f"# {name}: {j['bytes']} of {most_bytes} bytes, patch error {100 * j['force_error']['patch']['p95']:.3g} %, without "
          f"the limit {100 * reached['force_error_without']:.3g} % at {reached['bytes_without']} bytes")


def instructions(name, source, place, limit, *options):
    bank = place / "instructions.bank"
    r, j = build(source, bank, "--max-instructions", limit, *options)
    if r.returncode:
        check(f"{name}: {limit} instructions are kept", False, r.stderr)
        return
    reached = j["limits"]["instructions"]
    check(f"{name}: the bound of the worst tick is within {limit} instructions and near it",
          0.98 * limit < reached["reached"] <= limit and j["row_work"] > 0, j)
    cost = reached.get("tick_error_p95")
    check(f"{name}: it says what that costs along a fast stroke",
          cost is not None and cost <= reached["tick_error_max"] and reached["waits"] >= reached["waits_without"], j)
    why = PORT.missing()
    if why:
        skip(f"{name}: no counted tick takes more", why)
        return
    worst = worst_counted(place, bank)
    check(f"{name}: no counted tick takes more", 0 < worst <= limit, worst)
    print(f"# {name}: limit {limit}, bound {reached['reached']}, counted {worst}; {j['row_work']} units of row work, force "
          f"changed by {100 * cost:.2g} % (p95), {100 * reached['tick_error_max']:.2g} % (max), {reached['waits']} waits")


def block(place):
    write_block(place / "block.msh", (9, 8, 4))
    scene, bank = place / "block.yaml", place / "block.bank"
    scene.write_text(SCENE)
    r, free = build(scene, bank)
    bank.unlink()
    check("without limits none is reported", r.returncode == 0 and free["limits"] == {}, r.stderr + r.stdout)

    most = int(0.85 * free["bytes"])
    r, j = build(scene, bank, "--max-bytes", most)
    within("block", j, bank, most)
    info = json.loads(subprocess.run([trocar, "info", bank, "--json"], capture_output=True, text=True).stdout)
    check("the bank states the error that was reported", abs(info["provenance"]["force_error_p95"] /
          j["force_error"]["p95"] - 1) < 1e-3, info)
    verified = subprocess.run([trocar, "verify", bank, "--quiet"], capture_output=True, text=True)
    check("the bank passes its verification", verified.returncode == 0, verified.stderr)
    in_scene = place / "limited.yaml"
    in_scene.write_text(SCENE + "budget: {bank: %d B}\n" % most)
    other = place / "other.bank"
    _, k = build(in_scene, other)
    check("the scene's budget is the same limit", k.get("step") == j["step"] and k["bytes"] <= most, k)
    in_scene.write_text(SCENE + "effects: {swing: {modes: 8}}\n")
    r, k = build(in_scene, other, "--max-bytes", most)
    check("the sections of effects count towards the limit", r.returncode == 0 and k["bytes"] <= most and
          k["step"] > j["step"], r.stderr)
    os.unlink(bank)

    r, _ = build(scene, bank, "--max-bytes", 20000)
    least = allowed(r, "bytes")
    check("too few bytes are refused with the least, and nothing is written", refused(r, bank) and least > 20000, r.stderr)
    r, j = build(scene, bank, "--max-bytes", int(least or 0))
    check("the least is possible", r.returncode == 0 and j["bytes"] <= least, r.stderr)
    os.unlink(bank)
    r, _ = build(scene, bank, "--max-bytes", int(least or 0) - 1000)
    check("a little less is not", refused(r, bank), r.stderr)

    plain = 36 * free["free_surface_nodes"] * (free["free_surface_nodes"] + 1) // 2
    r, j = build(scene, bank, "--max-bytes", plain + 100000)
    check("a bank that fits as it is, is not compressed", r.returncode == 0 and "step" not in j and
          j["force_error"]["p95"] < 1e-5, r.stderr)
    os.unlink(bank)

    r, j = build(scene, bank, "--max-force-error", "1%")
    check("the force error keeps its limit on contacts that the search has not seen",
          r.returncode == 0 and 0 < j["force_error"]["p95"] <= 0.01, r.stderr)
    _, coarser = build(scene, bank, "--step", min(0.05, 1.4 * j["step"]))
    check("a coarser step would not", coarser["force_error"]["p95"] > 0.01 and coarser["bytes"] < j["bytes"], coarser)
    os.unlink(bank)
    r, _ = build(scene, bank, "--max-force-error", "0.00001%")
    check("an error below that of the finest step is refused with the least", refused(r, bank)
          and re.search(r"allow [\d.]+ %", r.stderr), r.stderr)

    r, _ = build(scene, bank, "--max-force-error", "0.1%", "--max-bytes", int(1.1 * least))
    needs = allowed(r, "bytes")
    check("limits that cannot be met together are refused with what each would take", refused(r, bank) and needs
          and "a force error of" in r.stderr, r.stderr)
    r, j = build(scene, bank, "--max-force-error", "0.1%", "--max-bytes", int(needs or 0))
    check("that is possible", r.returncode == 0 and j["bytes"] <= needs and j["force_error"]["p95"] <= 0.001, r.stderr)
    os.unlink(bank)
    r, _ = build(scene, bank, "--step", "1e-4", "--max-bytes", most)
    check("a given step is not turned: it is refused", refused(r, bank) and "step" in r.stderr, r.stderr)

    instructions("block", scene, place, 260000)
    r, _ = build(scene, bank, "--max-instructions", 1000)
    few = int(allowed(r, "instructions") * 3 / 4)  # of what all steps of the solver take: fewer steps can keep it
    r, _ = build(scene, bank, "--max-instructions", few)
    least = allowed(r, "instructions")
    check("too few instructions are refused with the least, before anything is computed", refused(r, bank) and least > few
          and "steps of the solver" in r.stderr, r.stderr)
    steps = re.search(r"write contact: \{steps: (\d+)\}", r.stderr)
    in_scene.write_text(SCENE + "contact: {steps: %s}\n" % (steps.group(1) if steps else "48"))
    r, j = build(in_scene, bank, "--max-instructions", few)
    check("with the solver's steps that it names they can be kept", bool(steps) and r.returncode == 0, r.stderr)
    for wrong in (["--max-bytes", "much"], ["--max-bytes", "0"], ["--max-instructions", "1.5"], ["--max-force-error", "200%"]):
        r, _ = build(scene, bank, *wrong)
        check(f"{' '.join(wrong)} is refused", r.returncode == 2 and wrong[0] in r.stderr, r.stderr)


def livers(place):
    for mesh, most in (("liver_smooth_1665_6691.msh", 524288), ("liver_smooth_6267_29596.msh", 1572864)):
        source = DATA / mesh
        if not source.exists():
            skip(f"{mesh} within its limits", f"{source} is not here")
            continue
        bank = place / "liver.bank"
        r, j = build(source, bank, "--extent", "0.214", "--max-bytes", most)
        check(f"{mesh}: {most} bytes can be met", r.returncode == 0, r.stderr)
        if r.returncode == 0:
            within(mesh, j, bank, most)
        bank.unlink(missing_ok=True)
        r, _ = build(source, bank, "--extent", "0.214", "--max-bytes", 100000)
        check(f"{mesh}: 100000 bytes are refused with the nearest", refused(r, bank) and allowed(r, "bytes") > 100000, r.stderr)
        print("# " + r.stderr.strip())
        instructions(mesh, source, place, 300000, "--extent", "0.214")


with tempfile.TemporaryDirectory(prefix="trocar-limits-") as folder:
    block(pathlib.Path(folder))
    if "TROCAR_LONG" in os.environ:
        livers(pathlib.Path(folder))
finish()
