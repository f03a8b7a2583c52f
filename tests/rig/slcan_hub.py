#!/usr/bin/env python3
"""slcan_hub.py FOLDER COUNT: a bus without CAN in the kernel. COUNT adapters that speak SLCAN, as FOLDER/0, FOLDER/1 ...

A frame that one is given goes to all others whose channel is open. Ready when FOLDER/ready exists; ends with a signal, and then
writes every frame, in order, as a candump log to FOLDER/log.
"""

import os
import select
import signal
import sys
import time
import tty

folder, count = sys.argv[1], int(sys.argv[2])
masters, slaves, rest, open_now, log = [], [], [], [], []
for i in range(count):
    master, slave = os.openpty()
    tty.setraw(slave)
    os.symlink(os.ttyname(slave), os.path.join(folder, str(i)))
    os.set_blocking(master, False)
    masters.append(master)
    slaves.append(slave)  # held, so that the line does not hang up between two programs
    rest.append(b"")
    open_now.append(False)


def finish(*_):
    with open(os.path.join(folder, "log"), "w") as out:
        out.write("".join("(%.6f) slcan %s#%s\n" % line for line in log))
    os._exit(0)


def write(master, text):
    try:
        os.write(master, text)
    except BlockingIOError:
        pass  # nobody reads there


def take(i, line):
    kind = line[:1]
    if kind == b"t":
        log.append((time.time(), line[1:4].decode(), line[5:].decode()))
        write(masters[i], b"z\r")
        for j, master in enumerate(masters):
            if j != i and open_now[j]:
                write(master, line + b"\r")
        return
    if kind in (b"O", b"C"):
        open_now[i] = kind == b"O"
    if line:
        write(masters[i], b"\r")


signal.signal(signal.SIGTERM, finish)
signal.signal(signal.SIGINT, finish)
poll = select.poll()
for master in masters:
    poll.register(master, select.POLLIN)
open(os.path.join(folder, "ready"), "w").close()
while True:
    for descriptor, _ in poll.poll():
        i = masters.index(descriptor)
        try:
            rest[i] += os.read(descriptor, 4096)
        except OSError:
            continue
        *lines, rest[i] = rest[i].split(b"\r")
        for line in lines:
            take(i, line)
