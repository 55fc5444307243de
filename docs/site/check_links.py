# SPDX-License-Identifier: Apache-2.0
"""usage: check_links.py DIR: checks every link of a web site to its own pages, their anchors and files, and that no page or style
sheet loads anything from elsewhere, and no script another one."""

import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

LOADED = {"script": "src", "img": "src", "link": "href", "iframe": "src", "source": "src"}


class Page(HTMLParser):
    def __init__(self, path):
        super().__init__()
        self.anchors, self.links, self.loaded = set(), [], []
        self.feed(path.read_text())

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.anchors.update(attributes[key] for key in ("id", "name") if attributes.get(key))
        if tag == "a" and attributes.get("href"):
            self.links.append(attributes["href"])
        if tag in LOADED and attributes.get(LOADED[tag]):
            self.loaded.append(attributes[LOADED[tag]])


def loaded_by_others(folder):
    """What style sheets and scripts load: (file, address)."""
    for path in folder.rglob("*.css"):
        for address in re.findall(r"""(?:@import\s+(?:url\()?|url\()["']?([^"')\s;]+)""", path.read_text()):
            if not address.startswith("data:"):
                yield path, address
    for path in folder.rglob("*.js"):
        for address in re.findall(r"""^import\b.*?["'](.+?)["']""", path.read_text(), re.M):
            yield path, address


def faults(folder):
    for path, address in loaded_by_others(folder):
        if path.suffix == ".js" or not (path.parent / address).is_file():
            yield f"{path.name} loads {address}"
    pages = {path.resolve(): Page(path) for path in folder.rglob("*.html")}
    for path, page in pages.items():
        for link in page.links + page.loaded:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                if link in page.loaded and parts.scheme != "data":
                    yield f"{path.name} loads {link}"
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.exists():
                yield f"{path.name}: no file {link}"
            elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].anchors:
                yield f"{path.name}: no anchor {link}"


if __name__ == "__main__":
    found = list(faults(Path(sys.argv[1])))
    print("\n".join(found), end="\n" if found else "", file=sys.stderr)
    sys.exit(bool(found))
