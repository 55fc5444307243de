# SPDX-License-Identifier: Apache-2.0
"""usage: run_page.py [--write] [--given FILE[=NAME]] [--from HEADING] [--until HEADING] [--packages DIR | --checkout]
SOURCE BUILD SCRATCH PAGE

Does what a page shows, in its order, in an empty folder: writes and changes its files, runs its commands and its Python, and compares
outputs with those on the page. --write puts the outputs of this run into the page instead. Exit status 4: something that
the page needs is not installed.

Commands run as on a reader's machine, except for these, which tests/docs/stand-ins replaces: `./run` other than its
commands build and package; `sudo apt`, which only looks; `sudo cmake --install`, which installs below SCRATCH.

In a clean root, no command is replaced: with --checkout (tests/package/sources.sh), the folder is SOURCE. With --packages
(tests/package/debian.sh), `./run` is, and DIR has the packages that it would make.

--given puts a file into the folder first. --from leaves out what stands before a heading, --until that heading and what follows it.
"""

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

from page import blocks, changed, commands, same_output

SKIPPED = 4
TIME_LIMIT = 900  # [s] of a page
END = "== end of output =="


def parse():
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--given", action="append", default=[])
    parser.add_argument("--from", dest="heading")
    parser.add_argument("--until")
    parser.add_argument("--packages", type=Path)
    parser.add_argument("--checkout", action="store_true")
    for name in ("source", "build", "scratch"):
        parser.add_argument(name, type=lambda text: Path(text).resolve())
    parser.add_argument("page")
    return parser.parse_args()


def quoted(text):
    return "'" + text.replace("'", "'\\''") + "'"


def script(page, scratch):
    """A shell script of all that the page does, and the console commands whose outputs it prints between marks."""
    lines, expected, python, files = ["set -euo pipefail"], [], [], {}
    for block in blocks(page):
        name = block.file_name()
        if block.use in ("after", "instead"):
            name = block.where.split(":")[0]
            files[name] = changed(files[name], block)
        elif name:
            files[name] = block.text
        if name:
            lines.append(f"cat >{name} <<'END OF FILE'\n{files[name]}END OF FILE")
        elif block.language == "sh":
            lines.append(block.text)
        elif block.language == "python":
            python.append(block.text)
            path = scratch / f"python-{len(python)}.py"
            path.write_text("\n".join(python))
            lines.append(f"python3 {quoted(str(path))}")
        elif block.language == "console":
            for command, output in commands(block.text):
                expected.append((command, output))
                lines.append(f"echo; echo {quoted('$ ' + command)}\n{{ {command}\n}} 2>&1\necho {quoted(END)}")
    return "\n".join(lines) + "\n", expected


def environment(options, home):
    """Finds what the installation page has installed, as /usr/local is found without any setting."""
    if options.packages or options.checkout:
        return dict(os.environ, HOME=str(home), BILAYER_SOURCE=str(options.source))
    installed = options.scratch / "installed" / "usr" / "local"
    python = next(installed.glob("lib/python3*/*-packages"), None)
    stand_ins = options.source / "tests" / "docs" / "stand-ins"
    result = dict(os.environ, HOME=str(home), BILAYER_BUILD=str(options.build), BILAYER_INSTALL_ROOT=str(options.scratch / "installed"),
                  PATH=f"{stand_ins}:{installed}/bin:/usr/bin:/bin", CMAKE_PREFIX_PATH=str(installed), CMAKE_GENERATOR="Ninja",
                  CMAKE_TOOLCHAIN_FILE=str(options.source / "tests" / "docs" / "toolchain.cmake"),
                  BILAYER_SOURCE=str(options.source))
    result.update({"PYTHONPATH": str(python)} if python else {})
    return result


def checkout(folder, options):
    """A folder that looks as the sources do once they are built."""
    (folder / "build").mkdir(parents=True)
    (folder / "build" / "release").symlink_to(options.build)
    (folder / "build" / "packages").symlink_to(options.packages or options.build.parent / "packages")
    (folder / "run").symlink_to(options.source / "tests" / "docs" / "stand-ins" / "run")
    return folder


def outputs(printed, expected):
    """The part of the printed text that belongs to each console command."""
    found = []
    for command, _ in expected:
        _, mark, rest = printed.partition(f"\n$ {command}\n")
        text, end, printed = rest.partition(END + "\n")
        if not mark or not end:
            return found
        found.append(text)
    return found


def main():
    options = parse()
    path = options.source / options.page
    page = path.read_text()
    scratch = options.scratch / options.page.replace("/", "-").removesuffix(".md")
    shutil.rmtree(scratch, ignore_errors=True)
    home = scratch / "home"
    home.mkdir(parents=True)
    folder = options.source if options.checkout else checkout(scratch / "checkout", options)
    for given in options.given:
        file, _, name = given.partition("=")
        if not Path(file).exists():
            print(f"skipped: {file} is not here")
            return SKIPPED
        shutil.copy(file, folder / (name or Path(file).name))

    begin = page.index(f"## {options.heading}\n") if options.heading else 0
    end = page.index(f"## {options.until}\n") if options.until else None
    text, expected = script(page[begin:end], scratch)
    result = subprocess.run(["bash", "-c", text], cwd=folder, env=environment(options, home), text=True,
                            timeout=None if options.checkout else TIME_LIMIT,
                            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if result.returncode:
        print(result.stdout)
        print(f"{options.page}: its commands end with {result.returncode}")
        return 1 if options.packages or options.checkout else result.returncode  # only the stand-in of sudo asks to skip
    status = 0
    for (command, shown), printed in zip(expected, outputs(result.stdout, expected), strict=True):
        if options.write:
            page = page.replace(f"$ {command}\n{shown}", f"$ {command}\n{printed}")
        elif not same_output(shown, printed):
            status = 1
            print(f"{options.page} shows:\n$ {command}\n{shown}\nThe output is:\n{printed}\nrun_page.py --write puts it there.")
    if options.write:
        path.write_text(page)
    return status


if __name__ == "__main__":
    sys.exit(main())
