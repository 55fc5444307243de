# SPDX-License-Identifier: Apache-2.0
"""The web site: Sphinx over the pages as they are, with the reference of C++ by Doxygen and Breathe.

The source folder is the whole checkout, so that links between pages need no change. The navigation is read from the tables of
docs/README.md; the pages of docs/reference/ get what the public headers declare.
"""

import re
import shutil
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parents[2]
XML = ROOT / "build" / "docs" / "doxygen" / "xml"
NAMESPACES = ("bilayer", "bilayer::bullet", "bilayer::fluid", "bilayer::metadata")

project = "bilayer"
copyright = "the authors of bilayer"
version = release = re.search(r"project\(bilayer VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text()).group(1)

extensions = ["myst_parser", "breathe"]
myst_enable_extensions = ["tasklist"]
root_doc = "README"
source_suffix = {".md": "markdown"}
include_patterns = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "RELEASE.md", "docs/**.md"]
exclude_patterns = ["docs/site/**"]
myst_heading_anchors = 4
highlight_language = "none"

html_theme = "furo"
html_title = f"bilayer {release}"
html_copy_source = False
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_sphinx = False
html_show_copyright = False
html_show_search_summary = False  # its texts are fetched, which browsers refuse for files
pygments_dark_style = "default"  # pages have one theme: Debian's Furo has no dark page

breathe_projects = {"bilayer": str(XML)}
breathe_default_project = "bilayer"
breathe_default_members = ("members",)
breathe_show_include = False
primary_domain = "cpp"

LINK = re.compile(r"\]\(([\w./-]+\.md)(?:#[\w-]*)?\)")


def navigation():
    """The sections of docs/README.md with the pages that they name first; each page once."""
    seen = {"README"}
    for section in re.split(r"^## ", (ROOT / "docs" / "README.md").read_text(), flags=re.M)[1:]:
        pages = []
        for link in LINK.findall(section):
            page = str((ROOT / "docs" / link).resolve().relative_to(ROOT)).removesuffix(".md")
            if page not in seen:
                seen.add(page)
                pages.append(page)
        if pages:
            yield section.splitlines()[0], pages


def contents():
    return "".join(f"\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n/" + "\n/".join(pages) + "\n```\n"
                   for caption, pages in [("All pages", ["docs/README"]), *navigation()])


def types(file):
    """Breathe's directives for the types that Doxygen found in a file, by line."""
    for inner in file.iter("innerclass"):
        kind = "class" if inner.get("refid").startswith("class") else "struct"
        detail = "::detail::" in inner.text or inner.get("prot") == "private"
        if not detail and inner.text.rpartition("::")[0] in NAMESPACES:
            place = ElementTree.parse(XML / f"{inner.get('refid')}.xml").find("compounddef/location").get("line")
            yield int(place), f"doxygen{kind}", inner.text, ":members:\n"


def members(namespace, header):
    """The same for the functions, enumerations and constants of a namespace that a header declares."""
    for member in namespace.iter("memberdef"):
        if member.find("location").get("file") != header:
            continue
        kind = member.get("kind")
        name = f"{namespace.findtext('compoundname')}::{member.findtext('name')}"
        parameters = ["".join(parameter.find("type").itertext()) for parameter in member.findall("param")]
        arguments = f"({', '.join(parameters)})" if kind == "function" else ""
        yield int(member.find("location").get("line")), f"doxygen{kind}", name + arguments, ""


def declared(header, compounds):
    """Directives for all that a header declares, in its order."""
    for compound in compounds:
        if compound.get("kind") == "file" and compound.find("location").get("file") == header:
            yield from types(compound)
        if compound.get("kind") == "namespace" and compound.findtext("compoundname") in NAMESPACES:
            yield from members(compound, header)


def reference(folder):
    """Directives for all public headers of a library, in the order of their declarations."""
    roots = [ElementTree.parse(path).find("compounddef") for path in sorted(XML.glob("*.xml"))]
    compounds = [root for root in roots if root is not None]
    for header in sorted((ROOT / folder).glob("*.h")):
        yield f"\n## `{folder}/{header.name}`\n"
        for _, directive, name, options in sorted(set(declared(f"{folder}/{header.name}", compounds))):
            yield f"\n```{{{directive}}} {name}\n{options}```\n"


def indexed(page):
    """The Python reference with entries of the index for its classes, functions and methods."""
    owner, lines, opens = "", [], False
    for line in page.splitlines():
        heading, function = re.match(r"### `(\w+)`", line), opens and re.match(r"(\w+)\(", line)
        if heading:
            owner = heading.group(1)
            lines += [f"```{{index}} single: {owner}; Python", "```", ""]
        elif function and function.group(1) != owner:
            lines[-1:] = [f"```{{index}} single: {owner}.{function.group(1)}; Python", "```", "", "```"]
        opens = line == "```" and not opens
        lines.append(line)
    return "\n".join(lines)


def add_to_page(app, name, source):
    if name == "docs/python-reference":
        source[0] = indexed(source[0])
    if name == "README":
        source[0] += contents()
    folder = re.search(r"^<!-- reference of (\S+) -->$", source[0], re.M)
    if folder:
        source[0] += "".join(reference(folder.group(1)))


def complete_theme(static):
    """Makes Debian's Furo work from a folder: its style sheet imports a file of a web server, and its script is a module, which
    browsers do not load from files."""
    scripts, sheet = static / "scripts", static / "styles" / "furo.css"
    shutil.copy("/usr/share/javascript/normalize.css/normalize.css", static / "styles")
    sheet.write_text(sheet.read_text().replace("/javascript/normalize.css/", ""))
    furo = (scripts / "furo.js").read_text().replace('import Gumshoe from "./gumshoe-patched.js";', "")
    (scripts / "furo.js").write_text((scripts / "gumshoe-patched.js").read_text() + furo)


def finish(app, error):
    if error is None:
        complete_theme(Path(app.outdir) / "_static")
        shutil.copy(Path(app.outdir) / "README.html", Path(app.outdir) / "index.html")


def setup(app):
    app.connect("source-read", add_to_page)
    app.connect("build-finished", finish)
