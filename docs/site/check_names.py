# SPDX-License-Identifier: Apache-2.0
"""usage: check_names.py DIR: checks that the reference of a web site has every public name of C++, but for destructors
and what is deleted."""

import re
import sys
from pathlib import Path

from sphinx.ext.intersphinx import InventoryFile

LISTED = Path(__file__).resolve().parents[2] / "tests" / "house" / "public_names.txt"
NAME = re.compile(r"\bbilayer::[\w:]+( bool|[^\w\s]+)?$")  # the last name; of operators, too
LEFT_OUT = re.compile(r"#|.*~|.*=delete$")


def listed():
    for line in LISTED.read_text().splitlines():
        if not LEFT_OUT.match(line):
            declaration = re.split(r"\(" if line.startswith("function ") else " = | : |, member ", line)[0]
            yield NAME.search(declaration).group()


def in_reference(site):
    with open(site / "objects.inv", "rb") as file:
        inventory = InventoryFile.load(file, "", lambda base, name: name)
    return {name.partition("(")[0] for kind, names in inventory.items() if kind.startswith("cpp:") for name in names}


missing = sorted(set(listed()) - in_reference(Path(sys.argv[1])))
if missing:
    sys.exit("the reference lacks these public names:\n" + "\n".join(missing))
