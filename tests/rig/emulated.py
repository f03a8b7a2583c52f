"""The controller's bare-metal images (firmware/ports with a processor of their own), emulators for them, and recordings.

An emulator runs a port's controller.elf. The bus is two files in lockstep (firmware/ports/lockstep.h): what the controller
reads is written down beforehand by tests/rig/recorder.c.
"""

import json
import os
import pathlib
import shutil
import struct
import subprocess

BUILD = pathlib.Path(os.environ.get("B", "build"))
NATIVE = BUILD / "firmware/native/controller.elf"
NATIVE_WITH_EFFECTS = BUILD / "firmware/native/all/controller.elf"
RECORDER = BUILD / "tests/rig/recorder"
TROCAR = BUILD / "trocar"
RECORD = struct.Struct("<IBBH8s")  # lockstep.h
FRAME, TIME = 0, 1
QUIET = dict(os.environ, QEMU_AUDIO_DRV="none")
TORQUES, EMERGENCY = 0x201, 0x081
SECONDS = 500  # of a run of an emulator, after which it is taken to hang


class Image:
    """A port's image. Those that an emulator can run say how in `machine`."""

    name = None      # folder of firmware/ports
    title = None
    flags = None     # of the compiler
    script = None    # of the linker
    compiler = ["arm-none-eabi-gcc"]
    emulator = []
    bank_address = None
    bank_bytes = 16 << 20  # its last word is the length of what is there

    def __init__(self):
        self.source = pathlib.Path("firmware/ports") / self.name
        self.build = BUILD / "firmware" / self.name
        self.image = self.build / "controller.elf"

    def missing_compiler(self):
        """Why it cannot be built here; None when it can."""
        return lacking(self.compiler)

    def missing(self):
        """Why it cannot run here; None when it can."""
        return lacking(self.compiler + self.emulator)

    def with_effects(self):
        """The same with every effect (make ports)."""
        other = type(self)()
        other.image = self.build / "all/controller.elf"
        return other

    def objects(self, suffix):
        """Files that the compiler wrote for the sources that there are; older ones may lie beside them."""
        for path in sorted(self.build.rglob("*" + suffix)):
            source = path.relative_to(self.build)
            if source.with_suffix(".c").exists() or source.with_suffix(".S").exists():
                yield path

    def command(self, arguments, bank=None, image=None, plugin=None):
        """What runs an image; the command line's arguments are file names without commas and spaces."""
        semihosting = "enable=on,target=native" + "".join(",arg=%s" % word for word in arguments)
        command = self.machine(image or self.image) + ["-display", "none", "-monitor", "none", "-serial", "none",
                                                       "-semihosting-config", semihosting]
        if bank:
            command += ["-device", "loader,file=%s,addr=%#x,force-raw=on" % (bank, self.bank_address),
                        "-device", "loader,addr=%#x,data=%d,data-len=4" % (self.bank_address + self.bank_bytes - 4,
                                                                         os.path.getsize(bank))]
        if plugin:
            command += ["-plugin", plugin]
        return command

    def emulate(self, *what, **more):
        """Run it. Returns the finished process."""
        process = subprocess.run(self.command(*what, **more), stdin=subprocess.DEVNULL, capture_output=True, text=True,
                                 timeout=SECONDS, env=QUIET)
        # what the emulator says of itself, for instance that it has no audio
        process.stderr = "".join(line for line in process.stderr.splitlines(True)
                                 if not line.startswith(("qemu-system-", "qemu: module ")))
        return process


def lacking(programs):
    return next((program + " is not installed" for program in programs if not shutil.which(program)), None)


class CortexM7(Image):
    name = "cortex_m7_an500"
    title = "Cortex-M7"
    emulator = ["qemu-system-arm"]
    flags = "-mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-sp-d16".split()
    script = "an500.ld"
    bank_address = 0x60000000

    def machine(self, image):
        return ["qemu-system-arm", "-M", "mps2-an500", "-kernel", str(image)]


class CortexR5(Image):
    """The image runs on an R5F; a Cortex-A53 of the same chip starts it and stands at the other end of its CAN bus."""

    name = "cortex_r5_zcu102"
    title = "Cortex-R5F"
    emulator = ["clang", "ld.lld", "qemu-system-aarch64"]
    flags = "-mcpu=cortex-r5 -mthumb -mfloat-abi=hard -mfpu=vfpv3xd".split()
    script = "zcu102.ld"
    bank_address = 0x10000000

    def machine(self, image):
        # One thread for all processors: a `yield` hands over to the next one, and counts do not race.
        return ["qemu-system-aarch64", "-M", "xlnx-zcu102,secure=on,canbus0=bus,canbus1=bus", "-object", "can-bus,id=bus",
                "-smp", "6", "-m", "512M", "-accel", "tcg,thread=single",
                "-global", "cortex-a53-arm-cpu.psci-conduit=1",
                "-device", "loader,file=%s,cpu-num=0" % (self.build / "bridge.elf"),
                "-device", "loader,file=%s" % image]


class Stm32h743(Image):
    name = "stm32h743"
    title = "STM32H743"


PORTS = [CortexM7(), CortexR5()]  # that an emulator can run
COMPILED = [Stm32h743()]          # that are built and measured only


def native(bank, answers, out, image=NATIVE):
    """The same objects as a process of this machine."""
    with open(answers, "rb") as source, open(out, "wb") as target:
        return subprocess.run([image, bank], stdin=source, stdout=target, stderr=subprocess.PIPE, timeout=SECONDS)


def record(bank, gesture, answers, ticks, *options):
    subprocess.run([RECORDER, bank, gesture, answers, ticks, *map(str, options)], check=True, timeout=SECONDS)


def build_bank(bank, source, *options):
    """What the build says of the bank."""
    done = subprocess.run([TROCAR, "build", source, *options, "-o", bank, "--json"], timeout=SECONDS, capture_output=True,
                          text=True)
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip())
    return json.loads(done.stdout)


def build_plugin(place):
    """ticks_plugin.c for the emulator's -plugin."""
    plugin = place / "ticks.so"
    subprocess.run(["gcc", "-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared", "-fvisibility=hidden",
                    os.path.join(os.path.dirname(os.path.abspath(__file__)), "ticks_plugin.c"), "-o", plugin], check=True)
    return plugin


def symbols(image):
    """Address of each symbol of an image."""
    listed = subprocess.run(["arm-none-eabi-nm", image], check=True, capture_output=True, text=True).stdout
    return {name: int(address, 16) for address, _, name in (line.split() for line in listed.splitlines())}


def count_ticks(port, plugin, bank, answers, out, ticks, begin, end, more=""):
    """Run the controller and return the instructions of each tick, from function `begin` to function `end`, and what it said."""
    at = symbols(port.image)
    process = port.emulate([answers, out], bank, plugin="%s,begin=%#x,end=%#x,ticks=%s%s" % (
        plugin, at[begin] & ~1, at[end] & ~1, ticks, more))
    if process.returncode != 0:
        raise RuntimeError(process.stderr.strip())
    return [int(line) for line in ticks.read_text().split()], process.stderr


def records(path):
    return list(RECORD.iter_unpack(path.read_bytes()))


def frames(path, wanted=None):
    """Data of the frames with this identifier (any, when None) in a lockstep file."""
    return [data[:length] for identifier, length, flags, kind, data in records(path)
            if kind == FRAME and wanted in (None, identifier)]


def logged(path, wanted):
    """Data of the frames with this identifier in a candump log."""
    found = []
    for line in path.read_text().splitlines():
        identifier, data = line.split()[2].split("#")
        if int(identifier, 16) == wanted:
            found.append(bytes.fromhex(data))
    return found
