#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# coverage.sh BUILD: prints which share of the lines of sdf and collider the fuzzers of a build folder have reached in its
# profiles, by fuzzer for the folders and by file for all of them together.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
build=$1
report() { # PROFILE SOURCES...: lines of files and their total
  llvm-cov-14 report "$build/fuzzer" --instr-profile="$1" --show-functions=false "${@:2}"
}
total() { # PROFILE SOURCES...: the share of lines, which LLVM 14 prints as the tenth word
  report "$@" 2> >(grep -v "functions have mismatched data" >&2) | awk '/^TOTAL/ { print $10; n = 1 } END { exit !n }'
}

printf '%-14s %10s %10s %10s %10s\n' fuzzer sdf/mesh sdf/io sdf collider
for folder in "$build"/profiles/*/; do
  name=$(basename "$folder")
  llvm-profdata-14 merge --output="$folder/all.profdata" "$folder"/*.profraw
  printf '%-14s' "$name"
  for sources in sdf/mesh sdf/io sdf collider; do
    share=$(total "$folder/all.profdata" $sources)
    printf ' %10s' "$share"
  done
  echo
done
llvm-profdata-14 merge --output="$build/all.profdata" "$build"/profiles/*/all.profdata
echo
report "$build/all.profdata" sdf collider | awk 'NR == 1 || /%/ { printf "%-60s %8s %8s %8s\n", $1, $8, $9, $10 }'
