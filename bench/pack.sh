#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Packs the device tests, the OpenCL benchmark and the command line, as built, with every shared library that they need, so
# that they run on a machine with an OpenCL driver and no packages: docs/opencl.md.
set -euo pipefail
(($# >= 2)) && [[ $2 != -* ]] || { echo "usage: bench/pack.sh BUILD DIR [MESH...]" >&2; exit 2; }
build=$1 folder=$2
shift 2
# What drivers may ask of the C library in addition to what the programs do: all of it must come from one and the same version.
LIBC_PARTS=(libdl.so.2 libm.so.6 libpthread.so.0 libresolv.so.2 librt.so.1)

[[ ! -e $folder ]] || { echo "pack: $folder is there already" >&2; exit 1; }
mkdir -p "$folder"/{bin,lib,meshes}
for program in test_cl bench_opencl bilayer; do
  strip -o "$folder/bin/$program" "$build/$program"
done

needed=$(ldd "$folder"/bin/*)
! grep 'not found' <<<"$needed" >&2 || exit 1
# "name => path (address)", and the loader itself without a name
libraries=$(awk '$2 == "=>" { print $3 } $1 ~ /^\// && $2 ~ /^\(/ { print $1 }' <<<"$needed")
libc=$(grep -m 1 '/libc\.so\.6$' <<<"$libraries")
sort -u <(printf '%s\n' "$libraries" "${LIBC_PARTS[@]/#/${libc%/*}/}") | xargs cp -L -t "$folder/lib"
(($# == 0)) || cp -L "$@" "$folder/meshes"
install -m 755 "$(dirname "$0")/packed.sh" "$folder/run"
