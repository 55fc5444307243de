#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Whether the lists that ./run prints name what the sources have, and come before anything is installed or built."""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FORBIDDEN = ["apt-get", "cmake", "dpkg-query", "ninja", "sudo"]
NO_PROGRAM = {"compare", "limits", "python"}  # benchmarks that are scripts


def programs(folder):
    """The names of the files of a folder that have a main()."""
    return {path.stem for path in (ROOT / folder).glob("*.cpp") if "int main(" in path.read_text()}


def fuzzers():
    return set(re.findall(r'^        {"(\w+)",', (ROOT / "tests/fuzz/seeds.cpp").read_text(), re.M))


def parts():
    text = (ROOT / "bench/paper/paper.cpp").read_text().partition("parts() {")[2].partition("\n}")[0]
    return set(re.findall(r'"(\w+)"|\b(?!parts)(\w+)\(\)[,};)]', text))


def listed(arguments, path):
    result = subprocess.run(["bash", ROOT / "run", *arguments], capture_output=True, text=True, env={"PATH": path})
    if result.returncode or result.stderr:
        sys.exit(f"./run {' '.join(arguments)} ends with {result.returncode}: {result.stderr}")
    return set(re.findall(r"^  (\w+)(?: |$)", result.stdout, re.M))


def main():
    demos = programs("demos")
    benches = programs("bench") | NO_PROGRAM
    names = {"demo --list": demos, "bench": benches, "bench --help": benches, "fuzz --list": fuzzers(),
             "paper --list": {a or b for a, b in parts() if (a or b) not in ("figureParts", "claimParts")}}
    faults = []
    with tempfile.TemporaryDirectory() as folder:
        for program in FORBIDDEN:
            path = Path(folder) / program
            path.write_text(f"#!/bin/sh\necho '{program} is called' >&2\nexit 1\n")
            path.chmod(0o755)
        for command, there in names.items():
            shown = listed(command.split(), f"{folder}{os.pathsep}/usr/bin{os.pathsep}/bin")
            faults += [f"./run {command} lists {name}, which is not in the sources" for name in sorted(shown - there)]
            faults += [f"./run {command} does not list {name}" for name in sorted(there - shown)]
    sys.exit("\n".join(faults) if faults else 0)


if __name__ == "__main__":
    main()
