# SPDX-License-Identifier: Apache-2.0
"""usage: form.py SOURCE: checks the form of pages: lines of at most 130 characters, items of lists of at most three lines,
paragraphs of at most six, cells of tables of at most 40 words, and a picture on each page that explains how contacts are found,
kept, reduced and bounced."""

import re
import sys
from pathlib import Path

CODE = re.compile(r"^```.*?^```$|^<!--.*?-->$", re.M | re.S)
ITEM = re.compile(r"\s*(?:[-*]|\d+\.) ")
MAX_ITEM, MAX_PARAGRAPH = 3, 6  # [lines]
MAX_CELL = 40                   # [words]
MAX_LINE = 130                  # of text; tables and pictures are wider
GENERATED = ["python-reference.md", "command-line-options.md"]
WITH_PICTURE = ["finding", "normals", "motion", "solver", "shapes", "extensions", "smooth-ground", "bullet-world"]
PICTURE = re.compile(r"!\[[^\]]+\]\(([\w./-]+)\)")


def text_of(page):
    """The page with empty lines in place of code and comments."""
    return CODE.sub(lambda code: "\n" * code.group().count("\n"), page)


def parts(page):
    """The first line number and the lines of each paragraph and item."""
    part = []
    for number, line in enumerate([*text_of(page).splitlines(), ""], 1):
        if part and (not line.strip() or ITEM.match(line) or line.startswith(("#", "|"))):
            yield number - len(part), part
            part = []
        if line.strip() and not line.startswith(("#", "|")):
            part.append(line)


def cells(page):
    """The line number, the number of words and the text of each cell of a table."""
    for number, line in enumerate(page.splitlines(), 1):
        for cell in line.strip("| ").split("|") if line.startswith("|") else ():
            yield number, len(cell.split()), cell.strip()


def faults(root):
    for path in [*sorted(root.glob("*.md")), *sorted((root / "docs").rglob("*.md"))]:
        page = path.read_text()
        for number, line in enumerate(text_of(page).splitlines(), 1):
            if len(line) > MAX_LINE and not line.startswith(("|", "!")) and path.name not in GENERATED:
                yield f"{path.relative_to(root)}:{number}: a line of {len(line)} characters, {MAX_LINE} at most"
        if path.name == "CHANGELOG.md":
            continue
        for number, words, cell in cells(page):
            if words > MAX_CELL:
                yield f"{path.relative_to(root)}:{number}: a cell of {words} words, {MAX_CELL} at most: {cell[:60]}"
        for number, lines in parts(page):
            # the repeated paper lists in each item all grids in which it is ahead
            limit = MAX_ITEM if ITEM.match(lines[0]) and path != root / "docs" / "paper.md" else MAX_PARAGRAPH
            if len(lines) > limit:
                yield f"{path.relative_to(root)}:{number}: {len(lines)} lines, {limit} at most: {lines[0].strip()[:60]}"
    for name in WITH_PICTURE:
        page = root / "docs" / "contacts" / f"{name}.md"
        pictures = PICTURE.findall(page.read_text())
        if not any((page.parent / picture).is_file() for picture in pictures):
            yield f"{page.relative_to(root)} has no picture"


if __name__ == "__main__":
    found = list(faults(Path(sys.argv[1])))
    sys.exit("\n".join(found) if found else 0)
