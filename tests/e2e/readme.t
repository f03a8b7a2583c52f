#!/usr/bin/env python3
# not sanitised: it runs the README's commands on the plain programs
"""Every command of the README runs as it stands there: the shell blocks in order, in a folder that has what the text says
the reader has (a mesh called liver.msh, 21 cm long in some unit), and the commands named in running text exist."""
import os
import re
import shutil
import subprocess
import sys
import tempfile

root = os.getcwd()
build = os.path.abspath(os.environ.get("B", "build"))
text = open("README.md", encoding="utf-8").read()
blocks = re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
commands = [line for block in blocks for line in block.splitlines() if line.strip() and not line.startswith("#")]
targets = set(re.findall(r"\bmake ([a-z]+)", text))
files = [t for t in re.findall(r"\]\(([^)#:]+)\)", text)]

print("1..%d" % (len(commands) + 2))
number = 0


def result(good, name, why=""):
    global number
    number += 1
    print("%sok %d - %s" % ("" if good else "not ", number, name))
    for line in why.strip().splitlines()[-8:]:
        print("#", line)


help_text = subprocess.run(["make", "help"], capture_output=True, text=True).stdout
unknown = [t for t in targets if not re.search(r"^\s*make %s\b" % t, help_text, re.MULTILINE)]
result(not unknown, "make targets that the README names exist", " ".join(unknown))
missing = [f for f in files if not os.path.exists(f)]
result(not missing, "files that the README points to exist", " ".join(missing))

with tempfile.TemporaryDirectory() as folder:
    os.symlink(build, os.path.join(folder, "build"))
    # the demo organ, meshed once more, stands for the reader's own
    made = subprocess.run([os.path.join(build, "trocar"), "mesh", "host/scenes/demo/liver.geo", "--unit", "m", "-o",
                           os.path.join(folder, "liver.msh")], capture_output=True, text=True)
    if made.returncode:
        sys.stderr.write(made.stderr)
    for command in commands:
        run = subprocess.run(["sh", "-c", command], cwd=folder, capture_output=True, text=True, timeout=300)
        result(run.returncode == 0, command, run.stderr if run.returncode else "")
