#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: class_lengths.py SOURCE: no class of the libraries or programs is long, with its members defined elsewhere in its
library."""
import collections
import pathlib
import re
import sys

MAX_LINES = 220
# Field only passes queries on. Half of its lines are comments: what each query promises.
LONGER = {("collider", "Field"): 255}
FOLDERS = ["sdf", "collider", "cl", "integration", "tools", "demos", "bench", "tests"]
# comments and texts, which may hold braces
IGNORED = re.compile(r"//[^\n]*|R\"(\w*)\(.*?\)\1\"|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])'", re.DOTALL)
TYPE = re.compile(r"\b(?:class|struct)\s+(?:alignas\([^)]*\)\s*)?([\w:]+)(?:\s+final)?\s*(?::[^;{]*)?\{")
MEMBER = re.compile(r"\n[^\n;{}()#]*?\b((?:[A-Z]\w+::)*[A-Z]\w+)::(?:~?\w+|operator\S+)\([^;{}]*\)[^;{}]*(?::[^;]*?)?\{")


def end_of_body(text, start):
    depth = 0
    for i in range(start, len(text)):
        depth += (text[i] == "{") - (text[i] == "}")
        if depth == 0:
            return i
    raise ValueError("braces do not match")


def lines(text, first, brace):
    return text[first:end_of_body(text, brace)].count("\n") + 1


def main():
    source = pathlib.Path(sys.argv[1])
    bodies, members = {}, collections.Counter()
    for folder in FOLDERS:
        for path in sorted((source / folder).rglob("*")):
            if path.suffix not in (".h", ".cpp"):
                continue
            text = IGNORED.sub(lambda found: re.sub(r"[^\n]", " ", found.group()), path.read_text())
            for found in TYPE.finditer(text):
                key = (folder, found.group(1))
                bodies[key] = max(bodies.get(key, 0), lines(text, found.start(), found.end() - 1))
            for found in MEMBER.finditer(text):
                members[(folder, found.group(1))] += lines(text, found.start() + 1, found.end() - 1)
    assert len(bodies) > 500, "classes are not found"
    # members of a class that is defined within another one
    for (folder, name), count in list(members.items()):
        if (folder, name) not in bodies:
            members[folder, name.rsplit("::", 1)[-1]] += count
    limits = {name: LONGER.get(name, MAX_LINES) for name in bodies}
    long = {name: count + members[name] for name, count in bodies.items() if count + members[name] > limits[name]}
    for name, count in sorted(long.items()):
        print(f"{name[1]} of {name[0]} has {count} lines, {limits[name]} at most")
    sys.exit(bool(long))


main()
