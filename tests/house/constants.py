#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: constants.py SOURCE: constants of a source file have names that no other file of its library has. Files are
compiled in groups, where one could stand for another without a word of the compiler."""
import collections
import pathlib
import re
import sys

LIBRARIES = ["sdf", "collider", "cl", "integration/bullet", "integration/fluid", "integration/python", "tools", "demos/shared",
             "tests/support", "tests/fuzz", "bench/paper"]
DECLARATION = re.compile(r"^(?:static |inline )*(?:constexpr|const) [^(){};=\"]*=[^;\"]*[;\"]", re.MULTILINE)
NAME = re.compile(r"\b(\w+)(?:\[\w*\])? = ")


def constants(text):
    return {name for found in DECLARATION.finditer(text) for name in NAME.findall(found.group())}


def main():
    source = pathlib.Path(sys.argv[1])
    failed = False
    for library in LIBRARIES:
        files = collections.defaultdict(list)
        for path in sorted((source / library).rglob("*.cpp")):
            text = path.read_text()
            if "HWY_TARGET_INCLUDE" not in text:  # compiled by itself
                for name in constants(text):
                    files[name].append(str(path.relative_to(source)))
        assert files, f"no constants in {library}"
        for name, where in sorted(files.items()):
            if len(where) > 1:
                failed = True
                print(f"{name} is a constant of {' and '.join(where)}: give each its own name, or both one in a header")
    sys.exit(failed)


main()
