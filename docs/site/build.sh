#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# usage: build.sh: builds the web site into build/docs/html. Undocumented or missing public names, broken links and all other warnings
# are errors.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
out=build/docs
rm -rf "$out"
mkdir -p "$out/source" "$out/doxygen"
doxygen docs/site/Doxyfile
python3 docs/site/check_documented.py "$out/doxygen/xml"
# the pages and what they link, where Sphinx finds nothing else: it follows links into all folders
ln -s "$PWD"/{README.md,CHANGELOG.md,CONTRIBUTING.md,SECURITY.md,RELEASE.md,LICENSE,docs} "$out/source/"
/usr/bin/sphinx-build -q -W --keep-going -b html -d "$out/doctrees" -c docs/site "$out/source" "$out/html"
python3 docs/site/check_links.py "$out/html"
/usr/bin/python3 docs/site/check_names.py "$out/html"
