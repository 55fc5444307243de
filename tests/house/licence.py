#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: licence.py [--write]: whether every source file names its licence in its first lines; --write adds it where it is
missing. Run by ./run format."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
IDENTIFIER = "SPDX-License-Identifier: Apache-2.0"
COMMENTS = {".h": "//", ".cpp": "//", ".cl": "//", ".py": "#", ".sh": "#", ".cmake": "#", "CMakeLists.txt": "#", "run": "#"}
FIRST_LINES = 3


def sources():
    """The source files under version control or about to be."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\0")
    for name in sorted(filter(None, names)):
        path = ROOT / name
        comment = COMMENTS.get(path.name) or COMMENTS.get(path.suffix)
        if comment and path.is_file() and not path.is_symlink():
            yield path, comment


def main():
    missing = []
    for path, comment in sources():
        lines = path.read_text().splitlines(keepends=True)
        if any(IDENTIFIER in line for line in lines[:FIRST_LINES]):
            continue
        missing.append(path.relative_to(ROOT))
        if "--write" in sys.argv:
            lines.insert(bool(lines and lines[0].startswith("#!")), f"{comment} {IDENTIFIER}\n")
            path.write_text("".join(lines))
    if missing and "--write" not in sys.argv:
        sys.exit("\n".join(f"{path} does not name its licence; ./run format adds it" for path in missing))


if __name__ == "__main__":
    main()
