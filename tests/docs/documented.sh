#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Whether Doxygen finds a documentation of every public name.
command -v doxygen >/dev/null || { echo "skipped: doxygen is not installed"; exit 4; }
output=$(mktemp -d)
trap 'rm -r "$output"' EXIT
{ cat docs/site/Doxyfile; echo "OUTPUT_DIRECTORY = $output"; } | doxygen -
