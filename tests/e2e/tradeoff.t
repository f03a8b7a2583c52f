#!/usr/bin/env python3
"""trocar tradeoff, from the outside: table, JSON and page show the same numbers, the page opens in a browser, refusals."""
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import xml.etree.ElementTree

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, "..")]
import view_browser
from block import SCENE, write_block
from tap import check, finish, skip

trocar = os.path.join(os.environ.get("B", "build"), "trocar")


def run(*arguments, **more):
    return subprocess.run([trocar, *map(str, arguments)], capture_output=True, text=True, timeout=900, **more)


def walk(value):
    """Every leaf of a JSON value, keys included: they are texts that may hold numbers."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield key
            yield from walk(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from walk(inner)
    else:
        yield value


NUMBER = re.compile(r"(?<![\w.])(-?\d+(?:\.\d+)?(?:e[+-]?\d+)?)( %| KiB)?")
SCALE = {" %": 0.01, " KiB": 1024.0, None: 1.0}


def missing_numbers(text, data):
    """Numbers of a text that are neither a number of the JSON, to the digits shown, nor stand in one of its texts."""
    leaves = list(walk(data))
    known = {float(x) for x in leaves if isinstance(x, (int, float)) and not isinstance(x, bool)}
    written = {m.group(1) for x in leaves if isinstance(x, str) for m in NUMBER.finditer(x)}
    missing = []
    for m in NUMBER.finditer(text):
        digits, unit = m.group(1), m.group(2)
        if digits in written:
            continue
        shown = float(digits)
        mantissa, _, exponent = digits.partition("e")
        half = 0.5 * 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
        if len(mantissa.lstrip("-").replace(".", "").lstrip("0")) < 3:  # "%.3g" drops zeros behind: three digits are shown
            half = min(half, 0.005 * abs(shown)) if shown else half
        if not any(abs(value / SCALE[unit] - shown) <= half * (1 + 1e-9) for value in known):
            missing.append(m.group(0))
    return missing


def fronts_are_right(data):
    faults = []
    for key, cost, error in (("front_bytes", lambda p: p["bytes"], lambda p: p["bank_error"]["patch"]["p95"]),
                             ("front_time", lambda p: p["instructions_per_ms_max"] if data["instructions_reason"] is None
                              else p["nanoseconds_max"], lambda p: p["tick_error"]["p95"])):
        same = lambda q: all(q["knobs"][k] == data["points"][0]["knobs"][k] for k in ("order", "refinement"))
        for i, p in enumerate(data["points"]):
            beaten = not same(p) or any(same(q) and (
                cost(q) <= cost(p) and error(q) <= error(p) and ((cost(q), error(q)) != (cost(p), error(p)) or j < i))
                for j, q in enumerate(data["points"]) if j != i)
            if p[key] == beaten:
                faults.append((key, p["name"]))
    return faults


def table_rows(text, names):
    """Cells by name: the columns are apart by two spaces or more."""
    rows = {}
    for line in text.splitlines():
        for name in names:
            if line.startswith(name + "  "):
                rows[name] = re.split(r"\s{2,}", line[len(name):].strip())
    return rows


def page_tests(page, data):
    text = None
    why = view_browser.missing()
    claims = ("the page opens in a browser without a complaint and asks the network for nothing",
              "every number that the page shows is in the JSON")
    if why:
        for claim in claims:
            skip(claim, why)
        return
    with view_browser.Browser(1200, 900) as browser:
        browser.open("file://" + page)
        text = browser.run("return document.body.innerText + '\\n' + "
                           "[...document.querySelectorAll('title')].map(t => t.textContent).join('\\n')")
        log = browser.log("browser")
        asked = [json.loads(e["message"])["message"]["params"]["request"]["url"] for e in browser.log("performance")
                 if '"Network.requestWillBeSent"' in e["message"]]
        marks = browser.run("return document.querySelectorAll('svg .mark').length")
    # chrome: and chrome-untrusted: are the browser's own first page, and load nothing from outside
    outside = [url for url in asked if not url.startswith(("file:", "data:", "chrome:", "chrome-untrusted:"))]
    check(claims[0], not log and not outside and marks >= len(data["points"]), (log, outside, marks))
    missing = missing_numbers(text, data)
    check(claims[1], not missing and len(NUMBER.findall(text)) > 100, missing)
    check("a number that is not in the JSON is seen by this test", missing_numbers("12.34567 and 98765 %", data) ==
          ["12.34567", "98765 %"])


def marks(path):
    """Setting, x and y of every mark of a plot, from its hover title."""
    found = {}
    for title in xml.etree.ElementTree.parse(path).iter("{http://www.w3.org/2000/svg}title"):
        name, numbers = title.text.rsplit(": ", 1)
        found[name] = tuple(float(m.group(1)) for m in NUMBER.finditer(numbers))
    return found


def readme_tests(again):
    """The picture in README.md, made by: trocar tradeoff --quick host/scenes/demo/demo.yaml --svg host/tradeoff/tradeoff.svg"""
    r = run("tradeoff", "--quick", "--quiet", "host/scenes/demo/demo.yaml", "--limit", "900", "--svg", again, "--json",
            env=dict(os.environ, PATH="/nowhere"))  # without valgrind: this plot shows no instructions
    there, here = marks("host/tradeoff/tradeoff.svg"), marks(again) if r.returncode == 0 else {}
    # three digits are shown; another linear algebra library rounds a few of the bank's integers otherwise
    near = lambda a, b: len(a) == len(b) == 2 and abs(a[0] / b[0] - 1) < 0.01 and abs(a[1] / b[1] - 1) < 0.05
    check("the plot in the readme shows what a run measures", len(there) >= 6 and there.keys() == here.keys() and
          all(near(there[name], here[name]) for name in there), (there, here, r.stderr))


def friction_tests(path):
    """Ten points with friction: what a bound of sweeps leaves of the force, and what it takes."""
    write_block(path("soft.msh"), (8, 6, 4))
    with open(path("friction.yaml"), "w") as out:
        out.write(SCENE.replace("block", "soft") + "instruments: [{name: right, tip: {radius: 20 mm, points: 10}}]\n"
                  "effects: {friction: {mu: 0.3}}\n")
    command = ("tradeoff", "--quick", "--quiet", path("friction.yaml"))
    without_valgrind = dict(os.environ, PATH="/nowhere")
    r = run(*command, "--json", "-o", path("friction.html"), env=without_valgrind)
    points = json.loads(r.stdout)["points"] if r.returncode == 0 else []
    base = points[0] if points else {}
    turned = sorted((p["knobs"]["sweeps"], p) for p in points if all(
        p["knobs"][k] == base["knobs"][k] for k in p["knobs"] if k != "sweeps"))
    sweeps = [n for n, _ in turned]
    check("with friction the solver is bounded by 2, 5, 10 and 20 sweeps, and not by factorisations", sweeps == [2, 5, 10, 20]
          and len({p["knobs"]["solver_steps"] for p in points}) == 1 and base["contacts_max"] == 10, (sweeps, r.stderr))
    left = [(p["solver_error"]["p95"], p["solver_error"]["max"]) for _, p in turned]
    check("more sweeps leave less of the force behind; two leave something, and twenty less than the solver's tolerance",
          len(left) == 4 and left == sorted(left, reverse=True) and left[0][0] > 1e-4 > left[3][1] and left[0] > left[1] > left[2],
          left)
    bounds, cut = [p["worst_tick_instructions"] for _, p in turned], [p["ticks_cut"] for _, p in turned]
    check("and take more: the bound of a tick rises by the same for each sweep, and fewer ticks are cut",
          len(bounds) == 4 and cut == sorted(cut, reverse=True) and cut[0] > 0
          and abs((bounds[1] - bounds[0]) * 10 / ((bounds[3] - bounds[2]) * 3) - 1) < 0.05, (bounds, cut))
    with open(path("friction.html")) as page:
        rows = re.findall(r"<tr[^>]*><td>(.*?)</tr>", page.read())
    shown = {row.split("</td><td>")[0]: row.split("</td><td>") for row in rows}
    check("the page says both for each bound of sweeps", all(
        "%.3g %%" % (100 * p["solver_error"][which]) in shown.get(p["name"], []) for _, p in turned for which in ("p95", "max")),
        shown.keys())
    r = run(*command, env=without_valgrind)
    rows = table_rows(r.stdout, [p["name"] for p in points])
    check("and so does the table", turned and all("%.3g %%" % (100 * p["solver_error"][which]) in rows.get(p["name"], [])
                                                  for _, p in turned for which in ("p95", "max")), rows)


def main(folder):
    path = lambda name: os.path.join(folder, name)
    write_block(path("block.msh"))
    with open(path("block.yaml"), "w") as out:
        out.write(SCENE)

    r = run("tradeoff", "--quick", "--quiet", path("block.yaml"), "--json", "--limit", "900", "-o", path("page.html"), "--svg",
            path("plot.svg"))
    check("a scene is measured", r.returncode == 0, r.stderr)
    data = json.loads(r.stdout) if r.returncode == 0 else {"points": []}
    check("stdout is one JSON object and stderr is silent", r.stdout.count("\n") == 1 and not r.stderr, r.stderr)
    points = data["points"]
    check("the first point is what the scene says, and others follow",
          len(points) >= 4 and points[0]["name"] == "as the scene says", points)
    check("every point has its errors of four kinds, its bytes by section and its times", points and all(
        set(p["bank_error"]) == {"one", "patch", "two", "field"} and p["nanoseconds_max"] >= p["nanoseconds_mean"] > 0
        and sum(p["section_bytes"].values()) < p["bytes"] < sum(p["section_bytes"].values()) + 64 + 64 * 32 + 64 * 16
        and p["build_seconds"] > 0 for p in points))
    plain = points[0]["bank_error"]["patch"]
    check("p95 is not above the maximum", all(e["p95"] <= e["max"] for p in points for e in
                                              [*p["bank_error"].values(), p["tick_error"]]), plain)
    linear = [p for p in points if p["name"] == "linear"][0]
    check("linear elements are stiffer than quadratic ones beside a refined body, under either tool",
          data["mesh_error_sites"] >= 8 and all(
              linear["mesh_error"][tool]["mean"] > 1.5 * points[0]["mesh_error"][tool]["mean"] > 0 and
              points[0]["mesh_error"][tool]["max"] >= points[0]["mesh_error"][tool]["mean"] for tool in ("tool", "wide_tool")),
          (points[0]["mesh_error"], linear["mesh_error"]))
    check("fewer points and less row work lower the bound of the worst tick", all(
        p["worst_tick_instructions"] < points[0]["worst_tick_instructions"] for p in points
        if p["knobs"]["points"] == 1 or p["knobs"]["row_work"] == 3))
    by = lambda knob: sorted((p["knobs"][knob], p) for p in points if all(
        p["knobs"][k] == points[0]["knobs"][k] for k in p["knobs"] if k != knob))
    steps = [(p["bytes"], p["bank_error"]["patch"]["p95"]) for step, p in by("step") if step > 0]
    check("a finer step makes the bank larger and truer", len(steps) >= 3 and steps == sorted(steps, reverse=True)
          and [e for _, e in steps] == sorted(e for _, e in steps), steps)
    check("the bank that is not compressed is the largest",
          all(p["bytes"] < points[i]["bytes"] or i == j for i, q in enumerate(points) if q["knobs"]["step"] == 0
              for j, p in enumerate(points)), points)
    if data["instructions_reason"] is None:
        costs = [p["instructions_max"] for _, p in by("points")]
        check("more tip points cost more instructions", len(costs) >= 3 and costs == sorted(costs) and costs[0] < costs[-1],
              costs)
        half = [p for p in points if p["knobs"]["rate_Hz"] == 500][0]
        check("half the rate is half the load",
              abs(half["instructions_per_ms_max"] / points[0]["instructions_per_ms_max"] - 0.5) < 1e-3)
    else:
        skip("more tip points cost more instructions", data["instructions_reason"])
        skip("half the rate is half the load", data["instructions_reason"])
    check("both fronts are those of the points", not fronts_are_right(data), fronts_are_right(data))
    page_tests(path("page.html"), data)
    tree = xml.etree.ElementTree.parse(path("plot.svg"))
    labels = " ".join(t.text for t in tree.iter("{http://www.w3.org/2000/svg}text"))
    check("the plot alone is a well-formed picture with its axes", "bytes" in labels and "patch error" in labels, labels)
    check("one factorisation in a tick leaves an error, and as many as the scene allows none", any(
        p["knobs"]["solver_steps"] == 1 and p["solver_error"]["max"] > 0 for p in points)
        and points[0]["solver_error"]["max"] == 0, [p["solver_error"] for p in points])
    readme_tests(path("readme.svg"))
    friction_tests(path)

    r = run("tradeoff", "--quick", "--quiet", path("block.yaml"), "--limit", "0.001", "-o", path("short.html"))
    rows = table_rows(r.stdout, ["as the scene says"])
    check("a time limit leaves settings out and says so", r.returncode == 0 and "left out" in r.stdout and
          len(rows) == 1, r.stdout + r.stderr)
    cells = rows.get("as the scene says", [])
    same = cells and cells[0] == "%.0f KiB" % (points[0]["bytes"] / 1024) or cells[:1] == ["%.3g KiB" % (points[0]["bytes"] / 1024)]
    error = lambda e: "%.3g %%" % (100 * e)
    wanted = [error(points[0]["bank_error"]["one"]["p95"]), error(points[0]["bank_error"]["patch"]["p95"]),
              error(points[0]["bank_error"]["patch"]["max"]), error(points[0]["bank_error"]["two"]["p95"]),
              error(points[0]["bank_error"]["field"]["p95"])]
    check("the table shows the JSON's numbers", bool(same) and cells[2:7] == wanted, (cells, wanted))

    r = run("tradeoff", path("nowhere.yaml"))
    check("a scene that is not there is refused", r.returncode == 3 and "nowhere.yaml" in r.stderr, r.stderr)
    r = run("tradeoff", path("block.msh"))
    check("a mesh is refused with the remedy", r.returncode == 2 and "trocar build MESH" in r.stderr, r.stderr)
    r = run("tradeoff", "--quick", path("block.yaml"), "-o", os.path.join(folder, "no", "page.html"))
    check("a page that cannot be written is refused before the long part", r.returncode == 3 and "page.html" in r.stderr
          and "measuring" not in r.stderr, r.stderr)
    r = run("tradeoff", "--quick", "--quiet", path("block.yaml"), "--json", "--limit", "0.001", env=dict(os.environ, PATH="/nowhere"))
    data = json.loads(r.stdout) if r.returncode == 0 else {}
    check("without valgrind the rest is measured, and it says so", "valgrind" in (data.get("instructions_reason") or "")
          and data["points"][0]["instructions_max"] is None and data["points"][0]["nanoseconds_mean"] > 0, r.stderr)

    temporary = path("tmp")
    os.mkdir(temporary)
    process = subprocess.Popen([trocar, "tradeoff", "--quick", path("block.yaml"), "-o", path("cut.html")], text=True,
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=dict(os.environ, TMPDIR=temporary))
    for line in process.stderr:  # until it is in the middle of its work
        if not line.startswith("measuring:   0"):
            break
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=300)
    check("Ctrl-C ends it with its own code, and leaves nothing", process.returncode == 130 and not out
          and not os.path.exists(path("cut.html")) and not os.listdir(temporary), (process.returncode, err, os.listdir(temporary)))


with tempfile.TemporaryDirectory(prefix="trocar-tradeoff-") as place:
    main(place)
finish()
