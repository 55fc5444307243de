#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: public_names.py [--write]: compares the public names of C++ with tests/house/public_names.txt; --write writes it anew.

docs/api-policy.md says which changes a version may make: in a minor version lines are added, and only deprecated ones go.
Exit status 4: Doxygen is not installed."""

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parents[2]
LIST = Path(__file__).with_suffix(".txt")
SKIPPED = 4
FIRST_LINES = """# SPDX-License-Identifier: Apache-2.0
# Public names of C++, by tests/house/public_names.py --write. See docs/api-policy.md.
"""


def text(element, tag):
    found = element.find(tag)
    return re.sub(r"\s+", " ", "".join(found.itertext())).strip() if found is not None else ""


def names(folder):
    """A line for each public name: its kind, its type, its qualified name, and the parameters of a function."""
    for path in folder.glob("*.xml"):
        compound = ElementTree.parse(path).find("compounddef")
        if compound is None or compound.get("kind") not in ("file", "struct", "class", "namespace"):
            continue
        kind, name = compound.get("kind"), compound.findtext("compoundname")
        if "detail" in name.split("::") or name == "std":
            continue
        if kind in ("struct", "class") and compound.get("prot") == "public":
            yield f"{kind} {name}"
        for member in compound.iter("memberdef"):
            if member.get("prot") != "public" or member.get("kind") == "friend":
                continue
            arguments = re.sub(r"\s+", " ", member.findtext("argsstring") or "") if member.get("kind") == "function" else ""
            type_name = text(member, "type")
            qualified = member.findtext("qualifiedname") or f"{name}::{member.findtext('name')}"
            yield " ".join(filter(None, (member.get("kind"), type_name, qualified + arguments)))
            for value in member.findall("enumvalue"):
                yield f"value {qualified}::{value.findtext('name')}"


def main():
    if not shutil.which("doxygen"):
        print("skipped: doxygen is not installed")
        return SKIPPED
    with tempfile.TemporaryDirectory() as folder:
        settings = (ROOT / "docs" / "site" / "Doxyfile").read_text() + f"OUTPUT_DIRECTORY = {folder}\nWARNINGS = NO\nWARN_AS_ERROR = NO\n"
        subprocess.run(["doxygen", "-"], input=settings, text=True, cwd=ROOT, check=True, stderr=subprocess.DEVNULL)
        found = sorted(set(names(Path(folder) / "xml")))
    if "--write" in sys.argv:
        LIST.write_text(FIRST_LINES + "\n".join(found) + "\n")
        return 0
    listed = LIST.read_text().splitlines()[FIRST_LINES.count("\n"):]
    for sign, lines in (("gone", set(listed) - set(found)), ("new", set(found) - set(listed))):
        for line in sorted(lines):
            print(f"{sign}: {line}")
    if listed != found:
        print("If docs/api-policy.md allows it: tests/house/public_names.py --write, and a line in CHANGELOG.md.")
    return int(listed != found)


if __name__ == "__main__":
    sys.exit(main())
