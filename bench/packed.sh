#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Runs a packed program with the packed libraries, C library included, and an OpenCL driver of this machine:
#
#   ./run test_cl | bench_opencl | bilayer [ARGUMENTS]
#
# The driver is NVIDIA's, unless OCL_ICD_VENDORS names another: a library, an .icd file or a folder of such files.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
[ $# -gt 0 ] && [ -x "$here/bin/$1" ] || { sed -n 's/^# *\(.*\)/\1/p' "$0" >&2; exit 2; }
program=$1
shift

# Folders where drivers lie: those that this machine searches, then those that containers and distributions use.
path=${LD_LIBRARY_PATH:-}
known=$( (PATH=$PATH:/sbin:/usr/sbin ldconfig -p 2>/dev/null || true) | sed -n 's|.*x86-64.*=> \(.*\)/libnvidia-opencl\.so\.1$|\1|p')
if [ -z "${OCL_ICD_VENDORS:-}" ]; then
  for folder in $(echo "$path" | tr : ' ') $known /usr/local/nvidia/lib64 /usr/lib/x86_64-linux-gnu /usr/lib64 \
    /run/opengl-driver/lib; do
    [ -e "$folder/libnvidia-opencl.so.1" ] || continue
    OCL_ICD_VENDORS=$folder/libnvidia-opencl.so.1
    path=${path:+$path:}$folder
    break
  done
  [ -n "${OCL_ICD_VENDORS:-}" ] || { echo "no libnvidia-opencl.so.1 here: set OCL_ICD_VENDORS" >&2; exit 1; }
fi
export OCL_ICD_VENDORS
export BILAYER_MESHES="${BILAYER_MESHES:-$here/meshes}" BILAYER_SCRATCH="${BILAYER_SCRATCH:-$here/scratch}"
# for a test that starts itself anew
export BILAYER_SELF="'$here/run' $program"
# by the loader's option and not by the environment: what a driver starts must keep its own libraries
exec "$here/lib/ld-linux-x86-64.so.2" --library-path "$here/lib${path:+:$path}" "$here/bin/$program" "$@"
