# SPDX-License-Identifier: Apache-2.0
"""usage: results.py SOURCE: checks that measured tables stand in docs/results/ and docs/paper.md alone, that each page there
says how its figures were measured, and that docs/results.md and docs/README.md link all of these pages."""

import re
import sys
from pathlib import Path

CONDITIONS = ["command", "machine", "date", "versions", "compared with"]
DATE = re.compile(r"\d{4}-\d\d-\d\d|not recorded")
TABLE = re.compile(r"^(\|[^\n]*)\n\|[ :|-]+\|\n((?:\|[^\n]*\n)*)", re.M)
MEASURED = re.compile(r"\[(?:us|ms|s|KB|MB|MiB|%)\]|\bns a query\b|\btimes as fast\b|\bseconds\b")  # in the head of a table


def tables(page):
    for head, body in TABLE.findall(page):
        yield head, [[cell.strip() for cell in row.strip("|").split("|")] for row in body.splitlines()]


def faults_of_results(name, page):
    conditions = [rows for head, rows in tables(page) if head == "| conditions | |"]
    if not conditions:
        yield f"{name} has no table of conditions"
    for rows in conditions:
        if [row[0] for row in rows] != CONDITIONS:
            yield f"{name}: a table of conditions has the rows {[row[0] for row in rows]} instead of {CONDITIONS}"
        elif not DATE.search(rows[2][1]):
            yield f"{name}: the date '{rows[2][1]}' is neither YYYY-MM-DD nor 'not recorded'"


def faults(root):
    docs = root / "docs"
    results = sorted((docs / "results").glob("*.md"))
    if not results:
        yield "docs/results has no page"
    for path in results:
        yield from faults_of_results(path.relative_to(root), path.read_text())
        for index in ("results.md", "README.md"):
            if f"(results/{path.name}" not in (docs / index).read_text():
                yield f"docs/{index} does not link results/{path.name}"
    for path in [root / "README.md", *sorted(docs.rglob("*.md"))]:
        if path.parent == docs / "results" or path in (docs / "results.md", docs / "paper.md"):
            continue
        for head, _ in tables(path.read_text()):
            if MEASURED.search(head):
                yield f"{path.relative_to(root)}: a measured table belongs into docs/results: {head}"


if __name__ == "__main__":
    found = list(faults(Path(sys.argv[1])))
    sys.exit("\n".join(found) if found else 0)
