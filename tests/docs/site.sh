#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Whether the web site builds: no warning, no broken link, no public name without documentation.
command -v doxygen >/dev/null && /usr/bin/python3 -c 'import sphinx, furo, myst_parser, breathe' 2>/dev/null ||
  { echo "skipped: the packages of ./run docs are not installed"; exit 4; }
exec docs/site/build.sh
