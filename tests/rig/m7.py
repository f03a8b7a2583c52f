"""The emulated Cortex-M7 (firmware/ports/cortex_m7_an500) and recordings for it.

An emulator runs the port's controller.elf on QEMU's machine mps2-an500. The bus is two files in lockstep
(firmware/ports/lockstep.h): what the controller reads is written down beforehand by tests/rig/recorder.c.
"""

import os
import pathlib
import shutil
import struct
import subprocess

QEMU = "qemu-system-arm"
BUILD = pathlib.Path(os.environ.get("B", "build"))
IMAGE = BUILD / "firmware/cortex_m7_an500/controller.elf"
NATIVE = BUILD / "firmware/native/controller.elf"
RECORDER = BUILD / "tests/rig/recorder"
TROCAR = BUILD / "trocar"
BANK_ADDRESS, BANK_LENGTH_ADDRESS = 0x60000000, 0x60FFFFFC
RECORD = struct.Struct("<IBBH8s")  # lockstep.h
FRAME, TIME = 0, 1
TORQUES, EMERGENCY = 0x201, 0x081
SECONDS = 500  # of a run of the emulator, after which it is taken to hang


def missing():
    """Why the emulated controller cannot run here; None when it can."""
    if not shutil.which("arm-none-eabi-gcc"):
        return "arm-none-eabi-gcc is not installed"
    if not shutil.which(QEMU):
        return QEMU + " is not installed"
    return None


def emulate(arguments, bank=None, image=IMAGE, plugin=None):
    """Run an image; the command line's arguments are file names without commas and spaces. Returns the finished process."""
    semihosting = "enable=on,target=native" + "".join(",arg=%s" % word for word in arguments)
    command = [QEMU, "-M", "mps2-an500", "-display", "none", "-monitor", "none", "-serial", "none",
               "-semihosting-config", semihosting, "-kernel", str(image)]
    if bank:
        command += ["-device", "loader,file=%s,addr=%#x,force-raw=on" % (bank, BANK_ADDRESS),
                    "-device", "loader,addr=%#x,data=%d,data-len=4" % (BANK_LENGTH_ADDRESS, os.path.getsize(bank))]
    if plugin:
        command += ["-plugin", plugin]
    return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=SECONDS)


def native(bank, answers, out):
    """The same objects as a process of this machine."""
    with open(answers, "rb") as source, open(out, "wb") as target:
        return subprocess.run([NATIVE, bank], stdin=source, stdout=target, stderr=subprocess.PIPE, timeout=SECONDS)


def record(bank, gesture, answers, ticks, *options):
    subprocess.run([RECORDER, bank, gesture, answers, ticks, *map(str, options)], check=True, timeout=SECONDS)


def build_bank(bank, source, *options):
    done = subprocess.run([TROCAR, "build", source, *options, "-o", bank], timeout=SECONDS, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip())


def frames(path, wanted):
    """Data of the frames with this identifier in a lockstep file."""
    return [data[:length] for identifier, length, flags, kind, data in RECORD.iter_unpack(path.read_bytes())
            if kind == FRAME and identifier == wanted]


def logged(path, wanted):
    """Data of the frames with this identifier in a candump log."""
    found = []
    for line in path.read_text().splitlines():
        identifier, data = line.split()[2].split("#")
        if int(identifier, 16) == wanted:
            found.append(bytes.fromhex(data))
    return found
