#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# usage: run.sh PYTHON FILE: runs a file of tests; exits with 4, which skips it, where pytest is missing.
python=$1
shift
"$python" -c 'import pytest' 2>/dev/null || { echo "skipped: pytest is not installed (python3-pytest)"; exit 4; }
"$python" -m pytest -q -p no:cacheprovider "$@"
status=$?
# 4 is pytest's own status for wrong usage
[ "$status" -ne 4 ] || status=1
exit "$status"
