"""A browser for tests: chromedriver and headless Chromium over the WebDriver protocol, with the standard library only.

    with Browser(1280, 800) as page:
        page.open("http://127.0.0.1:8471/")
        page.until("return trocar.frames > 10", "frames arrive", 60)
        pixels = page.picture("#canvas")

missing() says why there is no browser, or returns None. View is the program that serves the page; look, frames_per_second and clean
are what every test of the page asks."""
import base64
import json
import os
import shutil
import subprocess
import tempfile
import time
import traceback
import urllib.error
import urllib.request
import zlib
from urllib.parse import urlparse

DRIVERS = ("chromedriver", "/usr/lib/chromium/chromedriver")
CHROMIUM = ("chromium", "chromium-browser", "google-chrome")
TROCAR = os.path.join(os.environ.get("B", "build"), "trocar")
PATIENCE_S = 120  # only ends a test that would never end
SMALL, LARGE = (860, 480), (1280, 800)  # pages: the software renderer's time goes with the pixels
ELEMENT = "element-6066-11e4-a52e-4f735466cecf"  # the key of an element's reference, W3C WebDriver 12.1


def first(names):
    return next((path for path in map(shutil.which, names) if path), None)


def missing():
    if not first(DRIVERS):
        return "chromedriver is not installed (Debian: chromium-driver)"
    if not first(CHROMIUM):
        return "chromium is not installed (Debian: chromium)"
    return None


class Browser:
    def __init__(self, width, height, flags=()):
        self.folder = tempfile.TemporaryDirectory(prefix="trocar-browser-")
        # The driver prints its port when it is given none: no race for a free one.
        self.driver = subprocess.Popen([first(DRIVERS), "--port=0", "--allowed-ips=127.0.0.1"], stdout=subprocess.PIPE,
                                       stderr=subprocess.DEVNULL, text=True,
                                       env=dict(os.environ, HOME=self.folder.name))
        self.session = None
        try:
            for line in self.driver.stdout:
                if "started successfully on port" in line:
                    self.base = "http://127.0.0.1:%d" % int(line.rstrip(".\n").split()[-1])
                    break
            else:
                raise RuntimeError("chromedriver did not start")
            arguments = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
                         "--disable-background-networking", "--disable-component-update", "--disable-sync",
                         "--enable-unsafe-swiftshader", "--use-angle=swiftshader", "--hide-scrollbars",
                         "--disable-dev-shm-usage", "--force-device-scale-factor=1",
                         "--window-size=%d,%d" % (width, height), "--user-data-dir=" + self.folder.name + "/profile"]
            options = {"args": arguments + list(flags), "binary": first(CHROMIUM)}
            wanted = {"browserName": "chrome", "goog:chromeOptions": options,
                      "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"}}
            self.session = self.call("POST", "/session", {"capabilities": {"alwaysMatch": wanted}})["sessionId"]
            self.size(width, height)
        except BaseException:
            self.close()
            raise

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        if self.session:
            try:
                self.call("DELETE", "/session/" + self.session)
            except (OSError, RuntimeError):
                pass
        self.driver.terminate()
        try:
            self.driver.wait(10)
        except subprocess.TimeoutExpired:
            self.driver.kill()
            self.driver.wait()
        self.driver.stdout.close()
        self.folder._ignore_cleanup_errors = True
        self.folder.cleanup()

    def call(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.base + path, data, {"Content-Type": "application/json"}, method=method)
        try:
            with urllib.request.urlopen(request, timeout=120) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            value = json.load(error)["value"]
            raise RuntimeError("WebDriver: %s: %s" % (value["error"], value["message"].splitlines()[0])) from None

    def of(self, method, path, body=None):
        return self.call(method, "/session/" + self.session + path, body)

    def size(self, width, height):
        """Of the page: the window's would count the browser's own bars."""
        self.of("POST", "/goog/cdp/execute", {"cmd": "Emulation.setDeviceMetricsOverride", "params": {
            "width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}})

    def open(self, url):
        self.of("POST", "/url", {"url": url})

    def run(self, script, *arguments):
        return self.of("POST", "/execute/sync", {"script": script, "args": list(arguments)})

    def until(self, script, what, limit_s):
        """Ask until the script is true; the limit only ends a test that would never end."""
        end = time.monotonic() + limit_s
        while True:
            value = self.run(script)
            if value:
                return value
            if time.monotonic() > end:
                raise AssertionError("waited %d s in vain until %s" % (limit_s, what))
            time.sleep(0.05)

    def keys(self, *steps):
        """Steps: ("down", key), ("up", key), ("wait", milliseconds)."""
        names = {"down": "keyDown", "up": "keyUp"}
        actions = [{"type": "pause", "duration": value} if kind == "wait" else {"type": names[kind], "value": value}
                   for kind, value in steps]
        self.of("POST", "/actions", {"actions": [{"type": "key", "id": "keyboard", "actions": actions}]})

    def click(self, selector):
        element = self.of("POST", "/element", {"using": "css selector", "value": selector})[ELEMENT]
        self.of("POST", "/element/%s/click" % element, {})

    def png(self, selector=None):
        if not selector:
            return base64.b64decode(self.of("GET", "/screenshot"))
        element = self.of("POST", "/element", {"using": "css selector", "value": selector})[ELEMENT]
        return base64.b64decode(self.of("GET", "/element/%s/screenshot" % element))

    def picture(self, selector=None):
        return pixels(self.png(selector))

    def log(self, kind):
        return self.of("POST", "/se/log", {"type": kind})


def pixels(png):
    """(width, height, bytes per pixel, rows) of an 8-bit, not interlaced RGB or RGBA picture."""
    at, data = 8, b""
    while at < len(png):
        length, kind = int.from_bytes(png[at:at + 4], "big"), png[at + 4:at + 8]
        body = png[at + 8:at + 8 + length]
        if kind == b"IHDR":
            width, height = int.from_bytes(body[:4], "big"), int.from_bytes(body[4:8], "big")
            bpp = {2: 3, 6: 4}[body[9]]
            assert body[8] == 8 and body[12] == 0, "an unexpected PNG"
        elif kind == b"IDAT":
            data += body
        at += 12 + length
    raw, stride, rows = zlib.decompress(data), width * bpp, []
    before = bytearray(stride)
    for y in range(height):
        start = y * (stride + 1)
        kind, row = raw[start], bytearray(raw[start + 1:start + 1 + stride])
        if kind == 1:
            for i in range(bpp, stride):
                row[i] = (row[i] + row[i - bpp]) & 255
        elif kind == 2:
            row = bytearray((a + b) & 255 for a, b in zip(row, before))
        elif kind == 3:
            for i in range(stride):
                row[i] = (row[i] + ((row[i - bpp] if i >= bpp else 0) + before[i]) // 2) & 255
        elif kind == 4:
            for i in range(stride):
                a, b, c = (row[i - bpp], before[i], before[i - bpp]) if i >= bpp else (0, before[i], 0)
                p = a + b - c
                pa, pb, pc = abs(p - a), abs(p - b), abs(p - c)
                row[i] = (row[i] + (a if pa <= pb and pa <= pc else b if pb <= pc else c)) & 255
        rows.append(bytes(row))
        before = row
    return width, height, bpp, rows


def differing(first_picture, second_picture, threshold=24):
    """Number of pixels that differ by more than the threshold in a channel."""
    width, height, bpp, a = first_picture
    assert (width, height, bpp) == second_picture[:3], "pictures of different size"
    count = 0
    for row, other in zip(a, second_picture[3]):
        if row != other:
            count += sum(max(abs(row[i + k] - other[i + k]) for k in range(3)) > threshold
                         for i in range(0, width * bpp, bpp))
    return count


class View:
    """`trocar view` while it runs."""

    hosts = set()  # of all so far: a page asks for its old one until it is sent elsewhere

    def __init__(self, bank, *gestures):
        given = [word for gesture in gestures for word in ("--gesture", str(gesture))]
        self.process = subprocess.Popen([TROCAR, "view", str(bank), *given, "--port", "0"], stdout=subprocess.PIPE, text=True)
        self.address = self.process.stdout.readline().strip()
        assert self.address.startswith("http://127.0.0.1:"), "trocar view printed no address"
        View.hosts.add(urlparse(self.address).netloc)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(30)
        self.process.stdout.close()


def look(page, address):
    page.open(address)
    page.until("return window.trocar && trocar.connected && trocar.frames > 5", "frames arrive", PATIENCE_S)


def frames_per_second(page):
    """Frames that the page got per second of the run, over two seconds of it; the best of some windows, because a machine
    that is busy with other tests may hold the browser itself up."""
    best = 0
    for _ in range(5):
        frames, time_s = page.run("return [trocar.frames, trocar.time_s]")
        page.until("return trocar.time_s > %r" % (time_s + 2), "two seconds of the run go by", PATIENCE_S)
        after = page.run("return [trocar.frames, trocar.time_s]")
        best = max(best, (after[0] - frames) / (after[1] - time_s))
        if best >= 25:
            break
    return best


def clean(page, address):
    errors = [entry["message"] for entry in page.log("browser") if entry["level"] == "SEVERE"]
    assert not errors, "console: %s" % errors
    foreign = set()
    for entry in page.log("performance"):
        message = json.loads(entry["message"])["message"]
        params = message["params"]
        if message["method"] == "Network.requestWillBeSent" and params["documentURL"].startswith(address):
            url = params["request"]["url"]
        elif message["method"] == "Network.webSocketCreated":
            url = params["url"]
        else:
            continue
        if urlparse(url).scheme not in ("data", "blob") and urlparse(url).netloc not in View.hosts:
            foreign.add(url)
    assert not foreign, "requests to others: %s" % sorted(foreign)


class Skip(Exception):
    pass


def report(claims, *given):
    """Try each claim, a function of `given`, and print what became of it as TAP. The exit status."""
    print("1..%d" % len(claims), flush=True)
    failures = 0
    for number, claim in enumerate(claims, 1):
        name = claim.__name__.replace("_", " ")
        try:
            claim(*given)
            print("ok %d - %s" % (number, name), flush=True)
        except Skip as why:
            print("ok %d - %s # SKIP %s" % (number, name, why), flush=True)
        except Exception as fault:  # every claim is reported
            failures += 1
            print("not ok %d - %s" % (number, name))
            print("# " + (str(fault) or repr(fault)).replace("\n", "\n# "))
            print("# " + traceback.format_exc().strip().splitlines()[-3].strip(), flush=True)
    return 1 if failures else 0
