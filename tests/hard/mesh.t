#!/usr/bin/env python3
"""trocar mesh from the outside: what it prints, its exit codes, its JSON, and Ctrl-C while a surface is filled."""
import json
import os
import signal
import subprocess
import sys
import tempfile

BUILD = os.environ.get("B", "build")
TROCAR = os.path.join(BUILD, "trocar")
CUBE = "".join(f"v {i & 1} {i >> 1 & 1} {i >> 2}\n" for i in range(8)) + (
    "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n")
TWO = ("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n6\n1 0 0 0\n2 10 0 0\n3 0 10 0\n4 0 0 10\n5 10 10 10\n6 5 5 5\n"
       "$EndNodes\n$Elements\n2\n1 4 2 7 1 1 3 2 4\n2 4 2 8 1 2 3 4 5\n$EndElements\n")
count = 0
failed = 0


def ok(good, claim, detail=""):
    global count, failed
    count += 1
    failed += not good
    print(f"{'ok' if good else 'not ok'} {count} - {claim}")
    if not good:
        for line in str(detail).splitlines():
            print("#", line)


def run(*words, **options):
    return subprocess.run([TROCAR, "mesh", *words], capture_output=True, text=True, timeout=300, **options)


with tempfile.TemporaryDirectory() as folder:
    def file(name, text):
        path = os.path.join(folder, name)
        with open(path, "w") as f:
            f.write(text)
        return path

    two, cube = file("two.msh", TWO), file("cube.obj", CUBE)
    r = run(two)
    ok(r.returncode == 0 and "verdict: usable" in r.stdout and "file's unit" in r.stdout and "1 element reoriented" in
       r.stdout and "1 unused node dropped" in r.stdout, "without a unit it says so, and lists repairs", r)
    ok(not [line for line in r.stdout.splitlines() if line != line.rstrip()] and " , " not in r.stdout,
       "no blank stands for a unit that is not known", r)
    r = run(two, "--unit", "mm", "--json", "-o", os.path.join(folder, "out.msh"))
    j = json.loads(r.stdout)
    # corner of a cube of side 10, 1000/6, and a third of the cube: (1/6 + 1/3) of 1e-6 m3
    ok(abs(j["volume"] - 0.5e-6) < 1e-18 and j["unit"] == "m" and j["verdict"] == "usable" and
       [l["number"] for l in j["labels"]] == [7, 8] and sum(j["dihedral_histogram"]) == 12, "JSON in metres", r)
    j2 = json.loads(run(os.path.join(folder, "out.msh"), "--unit", "m", "--json").stdout)
    ok(j2["volume"] == j["volume"] and j2["reoriented"] == 0 and j2["nodes"] == 5, "-o writes the repaired mesh", j2)
    r = run(two, "--extent", "0.3", "--json")
    ok(abs(max(json.loads(r.stdout)["extent"]) - 0.3) < 1e-15, "--extent scales the longest side", r)
    r = run(cube, "--size", "0.5", "--json")
    ok(r.returncode == 0 and abs(json.loads(r.stdout)["volume"] - 1) < 1e-12, "a surface is filled", r)
    open_cube = file("open.obj", CUBE.rsplit("f", 1)[0])
    r = run(open_cube)
    ok(r.returncode == 4 and "4 edges" in r.stderr and "[MESH_OPEN]" in r.stderr and r.stderr.count("\n") == 1,
       "an open surface is refused in one line", r)
    crack = file("crack.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv -0 -0 0\nf 1 3 2\nf 1 2 4\nf 1 4 3\n")
    r = run(crack)
    ok(r.returncode == 4 and "-0" not in r.stderr, "there is one zero", r)
    crowd = file("crowd.obj", CUBE + "v 0.5 0.5 0.5\nf 1 2 9\nf 2 1 9\n")
    r = run(crowd)
    ok(r.returncode == 4 and " 1 edge of the surface has " in r.stderr, "one edge is not several", r)

    # -o: never over an input, by whatever name, nor over a file that is no mesh; over an earlier mesh it does write
    os.link(two, os.path.join(folder, "link.msh"))
    os.symlink("two.msh", os.path.join(folder, "soft.msh"))
    for name in ("two.msh", "link.msh", "soft.msh"):
        r = run(two, "-o", os.path.join(folder, name))
        ok(r.returncode == 3 and "input" in r.stderr and r.stderr.count("\n") == 1 and open(two).read() == TWO,
           f"-o {name} does not overwrite the input", r)
    r = run(two, "-o", cube)
    ok(r.returncode == 3 and "not a Gmsh mesh" in r.stderr and open(cube).read() == CUBE, "-o spares another file", r)
    r = run(two, "-o", os.path.join(folder, "out.msh"))
    ok(r.returncode == 0 and "5 " in open(os.path.join(folder, "out.msh")).read(), "-o replaces an earlier mesh", r)
    r = run(file("a.bank", "TRCB"))
    ok(r.returncode == 4 and "this is a Trocar bank, not a mesh" in r.stderr, "a bank is told from a mesh", r)
    apart = file("apart.msh", TWO.replace("2 4 2 8 1 2 3 4 5", "2 4 2 8 1 4 4 5 6"))
    r = run(apart, "--json")
    ok(r.returncode == 4 and json.loads(r.stdout)["verdict"] == "refused" and
       json.loads(r.stdout)["status"] == "MESH_DEGENERATE", "a refusal is in the JSON as well", r)
    for words, code in (([], 2), ([two, two], 2), ([two, "--unit", "inch"], 2), ([two, "--extent", "-1"], 2),
                        ([two, "--extent", "1", "--unit", "m"], 2), ([two, "--what"], 2),
                        (["/no/such.msh"], 3), (["--help"], 0)):
        r = run(*words)
        ok(r.returncode == code and (code == 0 or r.stderr.count("\n") == 1), f"exit code {code}", r)

    # Ctrl-C while the mesher works: it says when it has started by creating a file, then never ends
    started = os.path.join(folder, "started")
    os.mkfifo(started)
    mesher = file("mesher", f"#!/bin/sh\necho $$ > {started}\nexec tail -f /dev/null\n")
    os.chmod(mesher, 0o700)
    scratch = os.path.join(folder, "scratch")
    os.mkdir(scratch)
    p = subprocess.Popen([TROCAR, "mesh", cube], stderr=subprocess.PIPE, text=True,
                         env=dict(os.environ, TROCAR_MESHER=mesher, TMPDIR=scratch))
    with open(started) as f:
        child = int(f.read())
    p.send_signal(signal.SIGINT)
    error = p.communicate(timeout=60)[1]
    try:
        os.kill(child, 0)
        alive = True
    except ProcessLookupError:
        alive = False
    ok(p.returncode == 130 and "[INTERRUPTED]" in error and not alive and not os.listdir(scratch),
       "Ctrl-C ends the mesher and leaves no file", (p.returncode, error, alive))

print(f"1..{count}")
sys.exit(failed > 0)
