#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests bench/compare.py, called from the folder of the sources: losses beyond the spread are found, noise is not."""
import json
import random
import subprocess
import sys
import tempfile
from pathlib import Path

seed = random.randrange(2**32)
print("seed", seed)
chance = random.Random(seed)
folder = Path(tempfile.mkdtemp())


def file(name, ratios, benchmark="some", processor="one"):
    path = folder / name
    path.write_text(json.dumps({"benchmark": benchmark, "processor": processor, "cores": 2, "ratios": ratios}))
    return path


def rounds(ratio, noise):
    return [ratio * chance.uniform(1 - noise, 1 + noise) for _ in range(9)]


def compare(*arguments):
    return subprocess.run([sys.executable, "bench/compare.py", *map(str, arguments)], capture_output=True, text=True)


def require(condition, result):
    if not condition:
        sys.exit(f"seed {seed}\n{result.returncode}\n{result.stdout}\n{result.stderr}")


old = file("old", {"a / b": rounds(12, 0.02), "c / d": rounds(3, 0.02)})
same = compare(old, file("same", {"a / b": rounds(12, 0.02), "c / d": rounds(3, 0.02)}))
require(same.returncode == 0 and "0 of 2 lost" in same.stdout, same)
worse = compare(old, file("worse", {"a / b": rounds(9, 0.02), "c / d": rounds(3, 0.02)}))
require(worse.returncode == 3 and "1 of 2 lost" in worse.stdout and "| 0.7" in worse.stdout, worse)
require([line for line in worse.stdout.splitlines() if line.endswith("| loss |")][0].startswith("| a / b |"), worse)
allowed = compare(old, folder / "worse", "--tolerance", 0.5)
require(allowed.returncode == 0, allowed)
better = compare(folder / "worse", old)
require(better.returncode == 0 and "| gain |" in better.stdout, better)
noisy = compare(file("noisy", {"a / b": [8, 9, 10, 12, 14, 15, 16]}), file("noise", {"a / b": [8, 9, 9, 10, 13, 15, 16]}))
require(noisy.returncode == 0, noisy)
partly = compare(old, file("partly", {"a / b": [12], "e / f": [1]}, processor="another"))
require("Only in the old run: c / d" in partly.stdout and "Only in the new run: e / f" in partly.stdout, partly)
require("Different processors: one, another" in partly.stdout, partly)

broken = folder / "broken"
for text in ("", "[]", "{}", '{"ratios": {"a": ["x"]}}', '{"ratios": 3}'):
    broken.write_text(text)
    bad = compare(old, broken)
    require(bad.returncode == 1 and bad.stderr.count("\n") == 1 and str(broken) in bad.stderr, bad)
for bad in (compare(old, folder / "missing"), compare(old, file("other", {"a / b": [1]}, benchmark="another")),
            compare(old, file("nothing", {"x / y": [1]}))):
    require(bad.returncode == 1 and bad.stderr.count("\n") == 1, bad)
require(compare(old, old, "--tolerance", 2).returncode == 2, bad)
