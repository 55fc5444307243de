# SPDX-License-Identifier: Apache-2.0
"""usage: results.py SOURCE: checks that measured tables stand in docs/results/ and docs/paper.md alone, that each page there
says how its figures were measured and with which bilayer, that nothing is "not recorded", that docs/results.md and docs/README.md link all of these pages, that docs/results.md has their
first and last dates and their kinds of machines, and that other pages quote times and ratios with a link to the results that have
them."""

import re
import subprocess
import sys
from pathlib import Path

CONDITIONS = ["command", "machine", "date", "versions", "compared with"]
DATE = re.compile(r"\d{4}-\d\d-\d\d")
MACHINE = re.compile(r"EPYC|Xeon|NVIDIA \w+")
VERSION = re.compile(r"\bbilayer (?:\d+\.\d+\.\d+|([0-9a-f]{8}))\b")  # or a revision
UNKNOWN = re.compile(r"not recorded|not known|unknown|which, is not", re.I)  # of a condition
TABLE = re.compile(r"^(\|[^\n]*)\n\|[ :|-]+\|\n((?:\|[^\n]*\n)*)", re.M)
FIGURE = re.compile(r"\b([\d.,]*\d)(?: to ([\d.,]*\d))? (?:ns|us|ms|(?:times|frames) (?:as (?:fast|long)|a second))\b")
CELL = re.compile(r"[\d.,]+(?: to [\d.,]+)? (?:ns|us|ms|s|KB|MB|MiB|GiB)")  # a whole one of a table
NUMBER = re.compile(r"\d[\d,]*(?:\.\d+)?")
LINK = re.compile(r"\]\(([\w./-]+\.md)(?:#([\w-]*))?\)")
HEADING = re.compile(r"^(#+) (.*)$", re.M)
CODE = re.compile(r"^```.*?^```$", re.M | re.S)
PARAGRAPH = re.compile(r"\n\s*\n|\n(?=- |\d+\. |\|)")  # between two of them, items of lists or rows of tables
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
            continue
        if not DATE.search(rows[2][1]):
            yield f"{name}: the date '{rows[2][1]}' is not YYYY-MM-DD"
        if not VERSION.search(rows[3][1]):
            yield f"{name}: the versions '{rows[3][1]}' name neither a version nor a revision of bilayer"
        yield from (f"{name}: the {row} is '{value}'" for row, value in rows if UNKNOWN.search(value) or not value)


def conditions_of(page):
    """The dates and the machines that a page's conditions name; the repeated paper has its conditions in lines."""
    tabled = [row for head, rows in tables(page) if head == "| conditions | |" for row in rows]
    lines = re.findall(r"^\*`\./run paper [^\n]*?UTC|^Measured on: [^\n]*", page, re.M)
    named = {kind: " ".join(row[1] for row in tabled if row[0] == kind) for kind in ("date", "machine")}
    return DATE.findall(named["date"] or "\n".join(lines)), MACHINE.findall(named["machine"] or "\n".join(lines))


def faults_of_paper(root):
    """Parts of the repeated paper that do not name the bilayer that was measured."""
    for line in re.findall(r"^\*`\./run paper [^\n]*", (root / "docs" / "paper.md").read_text(), re.M):
        if not VERSION.search(line):
            yield f"docs/paper.md names no version or revision of bilayer: {line}"


def faults_of_index(root):
    """Rows of docs/results.md whose dates or machines are not those of the page."""
    index = next(rows for head, rows in tables((root / "docs" / "results.md").read_text()) if "| date | machine |" in head)
    for row in index:
        link = LINK.search(row[0])[1]
        dates, machines = conditions_of((root / "docs" / link).read_text())
        if set(DATE.findall(row[3])) != {min(dates), max(dates)}:
            yield f"docs/results.md: {link} was measured from {min(dates)} to {max(dates)}, not {row[3]}"
        if not set(MACHINE.findall(row[4])) == set(machines):
            yield f"docs/results.md: the machines of {link} are {sorted(set(machines))}, not {row[4]}"


def faults_of_revisions(root):
    """Revisions that the history does not have. A copy without history is not asked."""
    pages = [*(root / "docs" / "results").glob("*.md"), root / "docs" / "paper.md"]
    named = {rev for path in pages for rev in VERSION.findall(path.read_text()) if rev}
    shallow = subprocess.run(["git", "rev-parse", "--is-shallow-repository"], cwd=root, capture_output=True, text=True).stdout.strip()
    for revision in sorted(named if shallow == "false" else ()):
        if subprocess.run(["git", "cat-file", "-e", f"{revision}^{{commit}}"], cwd=root, stderr=subprocess.DEVNULL).returncode:
            yield f"docs/results or docs/paper.md: there is no revision {revision}"


def is_results(root, path):
    return path.parent == root / "docs" / "results" or path in (root / "docs" / "results.md", root / "docs" / "paper.md")


def rounds_to(figure, number):
    """Whether a figure, as it is written, is that number rounded to its digits."""
    digits = len(figure.partition(".")[2])
    return abs(float(figure.replace(",", "")) - float(number.replace(",", ""))) <= 0.5001 * 10.0**-digits


def section(page, anchor):
    """The text under the heading that an anchor names, without the headings at its level; all of the page without an anchor."""
    if not anchor:
        return page
    for heading in HEADING.finditer(page):
        level, title = heading.groups()
        if re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") == anchor:
            ends = (m.start() for m in HEADING.finditer(page, heading.end()) if len(m[1]) <= len(level))
            return page[heading.end() : next(ends, len(page))]
    return ""


def faults_of_quotes(root, path):
    """Times and ratios in the text of a page that no section of results has, or that come without a link to it."""
    for paragraph in PARAGRAPH.split(CODE.sub("", path.read_text())):
        figures = [figure for match in FIGURE.finditer(paragraph) for figure in match.groups() if figure]
        linked = [(path.parent / link, anchor) for link, anchor in LINK.findall(paragraph)]
        results = (section(page.read_text(), anchor) for page, anchor in linked if is_results(root, page.resolve()))
        numbers = NUMBER.findall("\n".join(results))
        for figure in figures:
            if not any(rounds_to(figure, number) for number in numbers):
                yield f"{path.relative_to(root)}: no section of results that is linked there has the figure {figure}: {paragraph.strip()}"


def faults_of_tables(root, path):
    for head, rows in tables(path.read_text()):
        if MEASURED.search(head) or any(CELL.fullmatch(cell) for row in rows for cell in row):
            yield f"{path.relative_to(root)}: a measured table belongs into docs/results: {head}"


def faults(root):
    root = root.resolve()
    docs = root / "docs"
    results = sorted((docs / "results").glob("*.md"))
    if not results:
        yield "docs/results has no page"
    for path in results:
        yield from faults_of_results(path.relative_to(root), path.read_text())
        for index in ("results.md", "README.md"):
            if f"(results/{path.name}" not in (docs / index).read_text():
                yield f"docs/{index} does not link results/{path.name}"
    yield from faults_of_index(root)
    yield from faults_of_paper(root)
    yield from faults_of_revisions(root)
    for path in [*sorted(root.glob("*.md")), *sorted(docs.rglob("*.md"))]:
        if "not recorded" in path.read_text():
            yield f"{path.relative_to(root)}: something is 'not recorded'"
        if not is_results(root, path):
            yield from faults_of_tables(root, path)
            yield from faults_of_quotes(root, path)


if __name__ == "__main__":
    found = list(faults(Path(sys.argv[1])))
    sys.exit("\n".join(found) if found else 0)
