#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: licence.py [--write]: whether every text file names its licence in its first lines; --write adds it where it is
missing. Files that can hold no comment, and pages and pictures, whose licence is in LICENSE, are left out. Run by ./run format."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
IDENTIFIER = "SPDX-License-Identifier: Apache-2.0"
WITHOUT = {".json", ".md", ".svg", ".typed"}  # and files that are no text
WITHOUT_NAMES = {"LICENSE"}
WITHOUT_FOLDER = "tests/fuzz/corpus/"  # inputs of programs, byte by byte
SLASHES = {".h", ".cpp", ".cl", ".dox"}
OTHERS = {".html": "<!-- {} -->", ".css": "/* {} */"}
BEFORE = ("#!", "<!doctype")  # the licence goes under such a line
FIRST_LINES = 3


def text_of(path):
    """The text of a file, or None of one that is no text."""
    try:
        content = path.read_bytes().decode()
    except UnicodeDecodeError:
        return None
    return None if "\0" in content else content


def sources():
    """The text files under version control or about to be that can name their licence, and their texts."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\0")
    for name in sorted(filter(None, names)):
        path = ROOT / name
        if path.suffix in WITHOUT or path.name in WITHOUT_NAMES or name.startswith(WITHOUT_FOLDER):
            continue
        if path.is_file() and not path.is_symlink() and (text := text_of(path)) is not None:
            yield path, text


def with_licence(path, text):
    comment = "// {}" if path.suffix in SLASHES else OTHERS.get(path.suffix, "# {}")
    lines = text.splitlines(keepends=True)
    lines.insert(bool(lines and lines[0].lower().startswith(BEFORE)), comment.format(IDENTIFIER) + "\n")
    return "".join(lines)


def main():
    missing = []
    for path, text in sources():
        if any(IDENTIFIER in line for line in text.splitlines()[:FIRST_LINES]):
            continue
        missing.append(path.relative_to(ROOT))
        if "--write" in sys.argv:
            path.write_text(with_licence(path, text))
    if missing and "--write" not in sys.argv:
        sys.exit("\n".join(f"{path} does not name its licence; ./run format adds it" for path in missing))


if __name__ == "__main__":
    main()
