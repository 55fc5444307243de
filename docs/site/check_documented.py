# SPDX-License-Identifier: Apache-2.0
"""usage: check_documented.py XML: checks in Doxygen's output that every public member, constructor and enumerator has a
description, but for destructors and what is deleted. Doxygen itself does not warn of
enumerators and of constructors without parameters."""

import sys
from pathlib import Path
from xml.etree import ElementTree


def described(element):
    parts = [element.find(kind) for kind in ("briefdescription", "detaileddescription")]
    return any("".join(part.itertext()).strip() for part in parts if part is not None)


def needs_description(member):
    name, arguments = member.findtext("name"), member.findtext("argsstring") or ""
    return member.get("prot") == "public" and not name.startswith("~") and not arguments.endswith("=delete")


def undescribed(compound):
    scope = compound.findtext("compoundname")
    for member in filter(needs_description, compound.iter("memberdef")):
        name = f"{scope}::{member.findtext('name')}"
        if not described(member):
            yield name + (member.findtext("argsstring") or "")
        yield from (f"{name}::{value.findtext('name')}" for value in member.iter("enumvalue") if not described(value))


found, count = [], 0
for path in Path(sys.argv[1]).glob("*.xml"):
    for compound in ElementTree.parse(path).iter("compounddef"):
        if compound.get("kind") in ("class", "struct", "namespace"):
            count += 1
            found += undescribed(compound)
if count == 0:
    sys.exit(f"{sys.argv[1]} has no output of Doxygen")
if found:
    sys.exit("these public names have no description:\n" + "\n".join(sorted(set(found))))
