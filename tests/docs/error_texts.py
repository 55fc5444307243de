# SPDX-License-Identifier: Apache-2.0
"""usage: error_texts.py SOURCE: checks that the sources have the messages that docs/errors.md lists, and the metadata that
docs/metadata.md lists are those that the sources name, with the version that they write."""

import re
import sys
from pathlib import Path

SHORTEST = 6  # letters of a text between dots that must be found


def sources(root):
    text = "".join(path.read_text() for folder in ("sdf", "collider", "cl", "integration", "tools")
                   for path in sorted((root / folder).rglob("*")) if path.suffix in (".cpp", ".h"))
    return re.sub(r'"\s*\n\s*"', "", text)  # literals over several lines are one


def missing_messages(page, code):
    for row in re.findall(r"^\| (`.*?`) \|", page, re.M):
        for message in re.findall(r"`([^`]+)`", row):
            for part in message.split("..."):
                if len(part.strip()) >= SHORTEST and part.strip() not in code:
                    yield f"docs/errors.md: no source has the text '{part.strip()}'"


def other_metadata(page, code):
    listed, named = set(re.findall(r"`(bilayer:\w+)`", page)), set(re.findall(r'"(bilayer:\w+)"', code))
    return [f"docs/metadata.md lists {name}, which no source names" for name in sorted(listed - named)] + \
           [f"docs/metadata.md does not list {name}" for name in sorted(named - listed)]


def other_version(page, source):
    shown, written = re.search(r"the version of these entries: (\d+)", page), re.search(r"int32_t format = (\d+);", source)
    if shown.group(1) != written.group(1):
        yield f"docs/metadata.md: entries of bodies have the version {shown.group(1)}, the sources write {written.group(1)}"


def main():
    root = Path(sys.argv[1])
    code, metadata = sources(root), (root / "docs" / "metadata.md").read_text()
    faults = [*missing_messages((root / "docs" / "errors.md").read_text(), code),
              *other_metadata(metadata, code),
              *other_version(metadata, (root / "collider" / "contact" / "body" / "body.cpp").read_text())]
    sys.exit("\n".join(faults) if faults else 0)


if __name__ == "__main__":
    main()
