#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Whether every public name is documented, enumerators and constructors included.
command -v doxygen >/dev/null || { echo "skipped: doxygen is not installed"; exit 4; }
output=$(mktemp -d)
set -e
trap 'rm -r "$output"' EXIT
{ cat docs/site/Doxyfile; echo "OUTPUT_DIRECTORY = $output"; } | doxygen -
python3 docs/site/check_documented.py "$output/xml"
