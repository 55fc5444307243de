#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: public_names.py [--write] [--build DIR] [KIND...]: compares what is public with the lists in tests/house; --write
writes them anew.

  names     of C++, with types, bases, parameters, their default values, and the order of members and enumerators:
            public_names.txt
  options   of the command line, with their types and default values: public_options.txt
  keys      of the output of --json, of runs: public_keys.txt
  python    names, parameters and fields of the Python module: public_python.txt

Without KIND: all that can be had. DIR has the program and the module; by default build/release. docs/api-policy.md says
which changes a version may make: in a minor version lines are added, and only deprecated ones go. Exit status 4: what a
kind needs is missing."""

import argparse
import inspect
import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parents[2]
SKIPPED = 4
FIRST_LINES = """# SPDX-License-Identifier: Apache-2.0
# What is public, by tests/house/public_names.py --write. See docs/api-policy.md.
"""
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
# for keys: commands in an order in which each finds the files that it reads
RUNS = """
build t.obj -o t.vdb --resolution 16
build t.obj -o body.vdb --resolution 16 --body --report
inspect t.obj
inspect t.obj --dt 0.01 --speed 1
info t.vdb
info body.vdb
build t.obj -o tiles --resolution 32 --tiles 2x1x1
merge tiles -o merged.vdb
export t.vdb -o t.nvdb
seed t.obj -o liquid.vdb --voxel-size 0.1 --particles 1
batch t.obj -o library --resolution 16 --body --inspect
batch --report library
devices""".strip().splitlines()


def text(element, tag):
    found = element.find(tag)
    return re.sub(r"\s+", " ", "".join(found.itertext())).strip() if found is not None else ""


def initial(member):
    """The default value of a variable or enumerator, as ` = VALUE`."""
    value = text(member, "initializer").removeprefix("=").strip()
    return f" = {value}" if value else ""


def words_before(member):
    virtual = ["virtual"] if member.get("virt") not in (None, "non-virtual") else []
    return virtual + [word for word in ("static", "explicit") if member.get(word) == "yes"]


def members_of(compound):
    name = compound.findtext("compoundname")
    place = 0  # of a variable in its struct, which initialisers depend on
    for member in compound.iter("memberdef"):
        if member.get("prot") != "public" or member.get("kind") == "friend":
            continue
        arguments = re.sub(r"\s+", " ", member.findtext("argsstring") or "") if member.get("kind") == "function" else ""
        qualified = member.findtext("qualifiedname") or f"{name}::{member.findtext('name')}"
        value = initial(member) if member.get("kind") == "variable" else ""
        if member.get("kind") == "variable" and compound.get("kind") == "struct" and member.get("static") == "no":
            place += 1
            value += f", member {place}"
        yield " ".join(filter(None, (member.get("kind"), *words_before(member), text(member, "type"), qualified + arguments))) + value
        for index, one in enumerate(member.findall("enumvalue")):
            yield f"value {qualified}::{one.findtext('name')}{initial(one) or f' = {index}'}"


def names(build):
    """A line for each public name of C++: its kind, type, qualified name, the parameters of a function, its value."""
    if not shutil.which("doxygen"):
        return None
    with tempfile.TemporaryDirectory() as folder:
        settings = (ROOT / "docs" / "site" / "Doxyfile").read_text()
        settings += f"OUTPUT_DIRECTORY = {folder}\nWARNINGS = NO\nWARN_AS_ERROR = NO\n"
        subprocess.run(["doxygen", "-"], input=settings, text=True, cwd=ROOT, check=True, stderr=subprocess.DEVNULL)
        compounds = [ElementTree.parse(path).find("compounddef") for path in (Path(folder) / "xml").glob("*.xml")]
    lines = []
    for compound in compounds:
        if compound is None or compound.get("kind") not in ("file", "struct", "class", "namespace"):
            continue
        kind, name = compound.get("kind"), compound.findtext("compoundname")
        if "detail" in name.split("::") or name == "std":
            continue
        if kind in ("struct", "class") and compound.get("prot") == "public":
            bases = [f"{base.get('prot')} {base.text}" for base in compound.findall("basecompoundref")]
            final = " final" if compound.get("final") == "yes" else ""
            lines.append(f"{kind} {name}{final}" + (" : " + ", ".join(bases) if bases else ""))
        lines += members_of(compound)
    return lines


def options_of(text):
    """The options and positionals of a help text: their form (names, type, limits), and the default that it states."""
    lines = text.split("Subcommands:\n")[0].splitlines()
    positionals = False
    for line, following in zip(lines, [*lines[1:], ""]):
        indent = len(line) - len(line.lstrip())
        if indent == 0:
            positionals = line == "Positionals:" or (positionals and not line)
        column = 28 + indent  # of descriptions, in this line or the next
        if indent not in (2, 4) or not (positionals or line.lstrip().startswith("-")):
            continue
        is_long = following.startswith(" " * column)
        form, about = (line, following) if is_long else (line[:column], line[column:])
        default = re.search(r"(\S+) \(default\b|\bdefault ([^,;)]+)", about)
        shown = (default[2] or (default[1] if " " in form.strip() else "on")) if default else ""
        yield form.strip() + (f" = {shown}" if shown else "")


def options(build):
    """A line for each option of each command."""
    program = build / "bilayer"
    if not program.exists():
        return None

    def help_of(*command):
        return subprocess.run([program, *command, "--help"], capture_output=True, text=True, check=True).stdout

    commands = re.findall(r"^  (\w+) ", help_of().split("Subcommands:\n")[1], re.M)
    return [f"bilayer {option}" for option in options_of(help_of())] + \
           [f"bilayer {command} {option}" for command in commands for option in options_of(help_of(command))]


def paths(value, prefix=""):
    """The keys of a JSON value, with those of inner objects after a dot and of lists after []."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield f"{prefix}.{key}".removeprefix(".")
            yield from paths(inner, f"{prefix}.{key}")
    elif isinstance(value, list):
        for inner in value:
            yield from paths(inner, f"{prefix}[]")


def keys(build):
    """A line for each key that a command prints."""
    program = build.resolve() / "bilayer"
    if not program.exists():
        return None
    lines = set()
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "t.obj").write_text(TETRAHEDRON)
        for run in RUNS:
            result = subprocess.run([program, *run.split(), "--json"], cwd=folder, capture_output=True, text=True)
            if result.returncode:
                raise SystemExit(f"bilayer {run} --json: {result.stderr}")
            command = "batch --report" if "--report" in run else run.split()[0]
            rest = result.stdout.strip()
            while rest:
                value, end = json.JSONDecoder().raw_decode(rest)
                listed = [path for path in paths(value) if command == "build" or not path.startswith("signs.")]  # texts
                lines |= {f"{command}: {path}" for path in listed}
                rest = rest[end:].strip()
    return lines


def python(build):
    """A line for each public name of the module, with its parameters; for each field of a result, with its place."""
    sys.path.insert(0, str(build / "python"))
    try:
        import bilayer
    except ImportError:
        return None
    lines = []
    for name in bilayer.__all__:
        value = getattr(bilayer, name)
        takes = inspect.isroutine(value) or "__signature__" in getattr(value, "__dict__", {})
        lines.append(f"{name}{inspect.signature(value) if takes else ''}")
        if inspect.isclass(value) and not issubclass(value, Exception):
            fields = getattr(value, "_fields", None) or list(getattr(value, "__dataclass_fields__", {}))
            lines += [f"{name}.{field} = {index}" for index, field in enumerate(fields)]
            for member, inner in vars(value).items():
                inner = getattr(inner, "__func__", inner)
                if not member.startswith("_") and member not in fields:
                    lines.append(f"{name}.{member}{inspect.signature(inner) if inspect.isroutine(inner) else ''}")
    return lines


KINDS = {"names": names, "options": options, "keys": keys, "python": python}


def compare(kind, found, path):
    listed = path.read_text().splitlines()[FIRST_LINES.count("\n"):]
    gone = set(listed) - set(found)
    if kind == "keys" and "devices: devices[].name" not in found:  # no device is here
        gone = {line for line in gone if not line.startswith("devices: devices[].")}
    changes = [f"gone: {line}" for line in sorted(gone)] + [f"new: {line}" for line in sorted(set(found) - set(listed))]
    for change in changes:
        print(change)
    return bool(changes)


def main():
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "release")
    parser.add_argument("kinds", nargs="*", metavar="KIND")
    given = parser.parse_args()
    status = 0
    for kind in given.kinds or KINDS:
        found, path = KINDS[kind](given.build), ROOT / "tests" / "house" / f"public_{kind}.txt"
        if found is None:
            print(f"skipped: {kind}: Doxygen, the program or the module is missing")
            status = status or (SKIPPED if given.kinds else 0)
        elif given.write:
            path.write_text(FIRST_LINES + "\n".join(sorted(set(found))) + "\n")
        elif compare(kind, set(found), path):
            status = 1
            print("If docs/api-policy.md allows it: tests/house/public_names.py --write, and a line in CHANGELOG.md.")
    return status


if __name__ == "__main__":
    sys.exit(main())
