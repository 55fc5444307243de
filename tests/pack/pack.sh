#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Packs, moves the pack, and runs all of its programs in an empty environment with this machine's OpenCL driver. Then
# looks where libraries came from: all that the programs need from the pack, and none twice for the driver's sake.
set -euo pipefail
build=$1 scratch=$2
name=$(cat /etc/OpenCL/vendors/*.icd 2>/dev/null | head -n 1) || name=
driver=$(find /usr/lib /usr/local/lib -name "${name##*/}" -print -quit)
[[ $name && $driver ]] || { echo "skipped: no OpenCL driver is here"; exit 4; }
rm -rf "$scratch"
mkdir -p "$scratch"
printf 'v 1 1 1\nv 1 -1 -1\nv -1 1 -1\nv -1 -1 1\nf 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n' >"$scratch/tetrahedron.obj"
"$(dirname "$0")/../../bench/pack.sh" "$build" "$scratch/here" "$scratch/tetrahedron.obj"
pack=$scratch/there
mv "$scratch/here" "$pack"

# PoCL looks for a linker in PATH
clean=(env -i PATH="$PATH" HOME="$scratch")
"${clean[@]}" OCL_ICD_VENDORS="$driver" "$pack/run" test_cl 'OpenCL and TBB agree without triangles'
"${clean[@]}" OCL_ICD_VENDORS="$driver" "$pack/run" bench_opencl --mesh "$pack/meshes/tetrahedron.obj" --resolution 32 \
  --repetitions 1
# and by NVIDIA's name, as it is found where nothing else is said; PoCL looks for its parts next to itself
mkdir "$scratch/driver"
ln -s "$driver" "$scratch/driver/libnvidia-opencl.so.1"
ln -s "${driver%/*}/pocl" "$scratch/driver"
"${clean[@]}" LD_LIBRARY_PATH="$scratch/driver" LD_DEBUG=libs LD_DEBUG_OUTPUT="$scratch/loaded" "$pack/run" bilayer devices |
  grep platform

loader=$pack/lib/ld-linux-x86-64.so.2
for program in "$pack"/bin/*; do
  "$loader" --library-path "$pack/lib" --list "$program" | grep -vF -e "$pack/lib/" -e linux-vdso &&
    { echo "not packed: the above, of $program" >&2; exit 1; }
done
# each process has a file; one was a shell before the packed loader took over, which begins with itself
loaded=$(awk -v loader="$loader" 'FNR == 1 { own = 0 } /calling init:/ { if ($NF == loader) own = 1; if (own) print $NF }' \
  "$scratch"/loaded.*)
grep -qF libopenvdb <<<"$loaded" || { echo "the loader did not tell what it loaded" >&2; exit 1; }
for library in $(grep -vF "$pack/" <<<"$loaded"); do
  [[ ! -e $pack/lib/${library##*/} ]] || { echo "not from the pack: $library" >&2; exit 1; }
done
rm -rf "$scratch"
