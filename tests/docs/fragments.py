# SPDX-License-Identifier: Apache-2.0
"""usage: fragments.py SOURCE BUILD SCRATCH: compiles the fragments of C++ on pages, each as the body of a function.

A fragment is a block of C++ that does not begin with the name of a file. A comment before it, `<!-- given: TYPE NAME, ... -->`,
declares what it uses. run_page.py runs those that change a program of their page. All public headers are included, and the namespace bilayer is used.
"""

import os
import subprocess
import sys
from pathlib import Path

from page import INCLUDE, blocks

SYSTEM = ["/usr/include/bullet", "/usr/include/Imath"]


def fragments(source):
    for path in [source / "README.md", *sorted((source / "docs").rglob("*.md"))]:
        page = path.read_text()
        for block in blocks(page):
            if block.language == "cpp" and not block.file_name() and block.use in (None, "given"):
                yield path.relative_to(source), page.count("\n", 0, block.begin) + 1, block


def program(source):
    headers = sorted(path.relative_to(source) for folder in ("sdf", "collider", "cl", "integration/bullet", "integration/fluid")
                     for path in (source / folder).glob("*.h"))
    includes, functions = ["#include <btBulletDynamicsCommon.h>\n", *(f"#include <bilayer/{header}>\n" for header in headers)], []
    for path, line, block in fragments(source):
        includes += INCLUDE.findall(block.text)
        body = INCLUDE.sub("\n", block.text)
        functions.append(f'static void fragment{len(functions)}({block.where or ""}) {{\n#line {line} "{path}"\n{body}}}\n')
    return "".join(includes) + "using namespace bilayer;\n" + "".join(functions), len(functions)


def main():
    source, build, scratch = (Path(argument).resolve() for argument in sys.argv[1:4])
    text, count = program(source)
    if count < 3:
        sys.exit(f"fragments.py: only {count} fragments found")
    scratch.mkdir(parents=True, exist_ok=True)
    file = scratch / "fragments.cpp"
    file.write_text(text)
    command = [os.environ.get("CXX", "g++"), "-std=c++20", "-fsyntax-only", "-Wall", "-Wno-unused", f"-I{build}/include"]
    sys.exit(subprocess.run(command + [f"-isystem{path}" for path in SYSTEM] + [str(file)]).returncode)


if __name__ == "__main__":
    main()
