# SPDX-License-Identifier: Apache-2.0
"""usage: check_documented.py XML: checks in Doxygen's output that every public member, constructor and enumerator has a
description, but for destructors and what is deleted, and that no sentence of errors hangs on the description of a parameter:
an empty line must end it. Doxygen itself does not warn of enumerators and of constructors without parameters."""

import sys
from pathlib import Path
from xml.etree import ElementTree


def described(element):
    parts = [element.find(kind) for kind in ("briefdescription", "detaileddescription")]
    return any("".join(part.itertext()).strip() for part in parts if part is not None)


def needs_description(member):
    name, arguments = member.findtext("name"), member.findtext("argsstring") or ""
    return member.get("prot") == "public" and not name.startswith("~") and not arguments.endswith("=delete")


def swallowed(compound):
    """Functions whose last parameter has the errors in its description."""
    for member in compound.iter("memberdef"):
        if any("Throws" in "".join(parameter.itertext()) for parameter in member.iter("parameterdescription")):
            yield f"{compound.findtext('compoundname')}::{member.findtext('name')}"


def undescribed(compound):
    scope = compound.findtext("compoundname")
    for member in filter(needs_description, compound.iter("memberdef")):
        name = f"{scope}::{member.findtext('name')}"
        if not described(member):
            yield name + (member.findtext("argsstring") or "")
        yield from (f"{name}::{value.findtext('name')}" for value in member.iter("enumvalue") if not described(value))


found, mixed, count = [], [], 0
for path in Path(sys.argv[1]).glob("*.xml"):
    for compound in ElementTree.parse(path).iter("compounddef"):
        if compound.get("kind") in ("class", "struct", "namespace"):
            count += 1
            found += undescribed(compound)
            mixed += swallowed(compound)
if count == 0:
    sys.exit(f"{sys.argv[1]} has no output of Doxygen")
if found:
    sys.exit("these public names have no description:\n" + "\n".join(sorted(set(found))))
if mixed:
    sys.exit("an empty comment line is missing between a parameter and 'Throws':\n" + "\n".join(sorted(set(mixed))))
