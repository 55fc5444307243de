# SPDX-License-Identifier: Apache-2.0
"""Pages of the documentation: their fenced blocks, and the comparison of outputs with what a page shows."""

import re
from dataclasses import dataclass

BLOCK = re.compile(r"(?:^<!-- (?P<use>given|after|instead): (?P<where>[^\n]*?) -->\n+)?^```(?P<language>[\w-]*)\n(?P<text>.*?)^```$", re.M | re.S)
NUMBER = re.compile(r"[-+]?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?( contacts)?")
# rows of times, memory and processors: only their presence is compared
MEASURED = re.compile(r"^\s*(files|time|build(?!\s+--)|peak memory|filled by)\s.*$", re.M)
RELATIVE_TOLERANCE = 0.02  # numbers on a page hold for other processors too
CONTACTS_TOLERANCE = 2     # of a body that moves; which contacts it has depends on rounding


@dataclass
class Block:
    language: str
    text: str
    begin: int  # of the text within the page
    # Of a fragment of C++ that a comment stands before. "given": where has the parameters of a function. "after" and
    # "instead": where is FILE: LINE or FILE: FIRST LINE: LAST LINE, parts of lines of a program on the page that it changes.
    use: str | None = None
    where: str | None = None

    def file_name(self):
        """The name in a comment on the first line, of a block that is a whole file: `// field.cpp`, `# CMakeLists.txt`."""
        match = re.match(r"(?://|#) (\w[\w.-]*\.\w+)\n", self.text)
        return match.group(1) if match else None


INCLUDE = re.compile(r"^#include .*\n", re.M)


def changed(program, block):
    """A program with a fragment in it: its includes at the top, the rest after or instead of the lines that it names."""
    _, first, *last = block.where.split(": ")
    lines = program.splitlines(keepends=True)
    begin = next(i for i, line in enumerate(lines) if first in line)
    end = begin + 1 + (next(i for i, line in enumerate(lines[begin:]) if last[0] in line) if last else 0)
    lines[begin if block.use == "instead" else end:end] = [INCLUDE.sub("", block.text).lstrip("\n")]
    head = lines.index("\n")
    return "".join([*lines[:head], *INCLUDE.findall(block.text), *lines[head:]])


def blocks(page):
    return [Block(m["language"], m["text"], m.start("text"), m["use"], m["where"]) for m in BLOCK.finditer(page)]


def commands(text):
    """The commands of a console block with the outputs that it shows: lines that begin with "$ ", and what follows."""
    pairs = []
    for line in text.splitlines(keepends=True):
        if line.startswith("$ "):
            pairs.append((line[2:].rstrip("\n"), ""))
        elif not pairs:
            raise SystemExit(f"a console block begins with output: {line}")
        else:
            pairs[-1] = (pairs[-1][0], pairs[-1][1] + line)
    return pairs


def tolerance(number):
    """The largest difference from a number that a page shows: two percent, or a step of its last digit behind the point."""
    text, contacts = number.removesuffix(" contacts"), number.endswith(" contacts")
    digits = len(text.partition(".")[2]) if "e" not in text else 0
    return max(RELATIVE_TOLERANCE * abs(value(number)), 10.0 ** -digits if digits else 0, CONTACTS_TOLERANCE if contacts else 0)


def value(number):
    return float(number.removesuffix(" contacts").replace(",", ""))


def close(shown, printed):
    return abs(value(shown) - value(printed)) <= tolerance(shown) * (1 + 1e-9)


def same_output(shown, printed):
    """Whether an output has the words of the one that is shown, and numbers within the tolerance."""
    shown, printed = (MEASURED.sub(r"\1", text) for text in (shown, printed))
    words = [" ".join(NUMBER.sub(" # ", text).split()) for text in (shown, printed)]
    numbers = [[match.group() for match in NUMBER.finditer(text)] for text in (shown, printed)]
    return words[0] == words[1] and all(close(a, b) for a, b in zip(*numbers))
