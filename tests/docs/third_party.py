# SPDX-License-Identifier: Apache-2.0
"""usage: third_party.py SOURCE BILAYER: checks that docs/third-party.md lists the libraries of others: the Debian packages of
all headers that sources include, those that ./run installs, and programs that tests look for; that `bilayer --version` names the
libraries that are in it; and that packages take the notices of those that are compiled in. Exit status 4: this is no Debian."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

SKIPPED = 4
INCLUDE = re.compile(r"^\s*#include <([^>$]+)>", re.M)
FOLDERS = ["", "bullet", *(str(path.relative_to("/usr/include")) for pattern in ("c++/*", "*-linux-gnu", "*-linux-gnu/c++/*")
                           for path in Path("/usr/include").glob(pattern)),
           *(f"../lib/{path.relative_to('/usr/lib')}" for path in Path("/usr/lib").glob("*-linux-gnu/openmpi/include"))]
SYSTEM = re.compile(r"libc6-dev|libstdc\+\+-\d+-dev|linux-libc-dev")
LIBRARIES = ("sdf", "collider", "cl", "integration", "tools")
ELSEWHERE = {"OpenCL ICD loader", "Open MPI", "pybind11"}  # not in the command line, or without a version in its headers


def section(page, title):
    return page.partition(f"\n## {title}\n")[2].partition("\n## ")[0]


def rows(page, title):
    """Cells of the rows of the table in a section."""
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in section(page, title).splitlines()
            if line.startswith("| ")][1:]


def packages_of(page, title):
    return {package for row in rows(page, title) for package in re.findall(r"`([\w.+-]+)`", row[1])}


def headers(root, folders):
    """The files outside of the project that are included."""
    files = [path for folder in folders for path in (root / folder).rglob("*") if path.suffix in (".h", ".cpp")]
    names = sorted({name for file in files for name in INCLUDE.findall(file.read_text()) if not name.startswith("bilayer/")})
    found = (next((path for folder in FOLDERS if (path := Path("/usr/include") / folder / name).exists()), None) for name in names)
    return [str(path.resolve()) for path in found if path]


def packages_of_headers(paths):
    result = subprocess.run(["dpkg", "-S", *paths], capture_output=True, text=True)
    return {line.partition(":")[0] for line in result.stdout.splitlines() if not SYSTEM.match(line)}


def installed_by_run(root):
    arrays = re.findall(r"^[A-Z_]+_PACKAGES=\(([^)]*)\)", (root / "run").read_text(), re.M)
    return {word for array in arrays for word in array.split() if re.match(r"[a-z]", word)}


def faults(root, program):
    page = (root / "docs" / "third-party.md").read_text()
    listed = set(re.findall(r"`([\w.+-]+)`", page))
    linked, compiled = packages_of(page, "Linked"), packages_of(page, "Compiled in")
    ours, all_of_them = (packages_of_headers(headers(root, folders)) for folders in (LIBRARIES, (*LIBRARIES, "tests", "bench", "demos")))
    if len(ours) < 15:
        yield f"only the packages {sorted(ours)} of headers are found"
    yield from (f"{package} is included by a library, and neither linked nor compiled in" for package in sorted(ours - linked - compiled))
    yield from (f"{package} is used and not listed" for package in sorted((all_of_them | installed_by_run(root)) - listed))

    scripts = [path.read_text() for path in (root / "tests").rglob("*.sh")] + [(root / "run").read_text()]
    looked_for = {name for text in scripts for name in re.findall(r"command -v ([\w.-]+)", text)}
    yield from (f"the program {name} is not named" for name in sorted(looked_for) if not re.search(rf"\b{name}\b", page, re.I))

    taken = re.search(r"set\(BILAYER_COMPILED_IN\s+([^)]*)\)", (root / "cmake" / "packages.cmake").read_text())[1].split()
    yield from (f"{package} is in 'Compiled in' or in BILAYER_COMPILED_IN alone" for package in sorted(compiled ^ set(taken)))

    printed = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout
    versions = dict(re.findall(r"^(.+?)  +(.+)$", printed, re.M))
    named = {row[0] for title in ("Linked", "Compiled in") for row in rows(page, title)} - ELSEWHERE
    yield from (f"bilayer --version and the page do not name the same: {name}" for name in sorted(named ^ set(versions) - {"compiler"}))
    yield from (f"the version of {name} is unknown" for name, version in versions.items() if version == "unknown")


if __name__ == "__main__":
    if not shutil.which("dpkg"):
        print("skipped: this is no Debian")
        sys.exit(SKIPPED)
    found = [f"docs/third-party.md: {fault}" for fault in faults(Path(sys.argv[1]), sys.argv[2])]
    sys.exit("\n".join(found) if found else 0)
