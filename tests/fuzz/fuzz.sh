#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# fuzz.sh BUILD SECONDS NAME [LIMIT]: runs one fuzzer of a build folder, at first on its first inputs, on the inputs in
# tests/fuzz/corpus, and on those that earlier runs found. An input may take LIMIT seconds. Prints what it finds, which stays
# in BUILD/findings.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
build=$1 seconds=$2 name=$3 limit=${4:-20}
scratch=$(mktemp -d -p "$([[ -w /dev/shm ]] && echo /dev/shm || echo /tmp)" bilayer-fuzz.XXXXXX)
trap 'rm -rf "$scratch"' EXIT
export BILAYER_FUZZER=$name BILAYER_SCRATCH=$scratch UBSAN_OPTIONS=print_stacktrace=1 ASAN_OPTIONS=detect_leaks=0
seeds=$scratch/seeds
"$build/fuzzer" --seeds="$seeds"
mkdir -p "$build/corpus/$name" "$build/findings"
inputs=("$build/corpus/$name" "$seeds/$name")
[[ ! -d tests/fuzz/corpus/$name ]] || inputs+=(tests/fuzz/corpus/"$name")
dictionary=()
[[ ! -s $seeds/$name.dict ]] || dictionary=(-dict="$seeds/$name.dict")
result=0
"$build/fuzzer" -max_total_time="$seconds" -timeout="$limit" -report_slow_units="$limit" \
  -rss_limit_mb=3000 -malloc_limit_mb=1000 \
  -max_len="$("$build/fuzzer" --list | sed -n "s/^$name //p")" "${dictionary[@]}" -print_final_stats=1 \
  -artifact_prefix="$build/findings/$name-" "${inputs[@]}" >"$build/$name.log" 2>&1 || result=1
echo "$name: $(sed -n 's/^stat::number_of_executed_units: *//p' "$build/$name.log") inputs"
((result == 0)) || tail -n 60 "$build/$name.log"
for finding in "$build/findings/$name"-*; do
  [[ ! -e $finding ]] || { echo "finding: BILAYER_FUZZER=$name $build/fuzzer $finding"; result=1; }
done
exit $result
