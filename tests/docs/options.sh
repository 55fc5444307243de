#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# usage: options.sh PYTHON BILAYER: whether docs/command-line-options.md is what docs/command_line.py prints.
"$1" docs/command_line.py "$2" | diff docs/command-line-options.md - ||
  { echo "write it anew: docs/command_line.py build/release/bilayer >docs/command-line-options.md"; exit 1; }
