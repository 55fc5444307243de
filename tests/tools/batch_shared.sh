# SPDX-License-Identifier: Apache-2.0
# What the tests of batches under other schedulers share. They are skipped by exit status 4.
set -euo pipefail

skipped=4

# need PROGRAM...: skips the test where a program is missing.
need() {
  local program
  for program in "$@"; do
    PATH=$PATH:/usr/sbin:/sbin command -v "$program" >/dev/null || { echo "skipped: there is no $program"; exit "$skipped"; }
  done
}

# make_library FOLDER COUNT: different boxes as OBJ files.
make_library() {
  local folder=$1 count=$2 i
  mkdir -p "$folder/a" "$folder/b"
  for ((i = 0; i < count; ++i)); do
    local to=$folder/a
    ((i % 2)) || to=$folder/b
    awk -v h="1.$((100 + i))" 'BEGIN {
      for (z = 0; z < 2; ++z) for (y = 0; y < 2; ++y) for (x = 0; x < 2; ++x) print "v", x, y, z * h
      print "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6" }' >"$to/$i.obj"
  done
}

# require_same FOLDER FOLDER: the fields of two batches have the same names and bytes. OpenVDB's random identifier at the
# start and the checksum at the end of a file differ always.
require_same() {
  local identifier_end=57 checksum=23 name size
  diff <(cd "$1" && find . -name '*.vdb' | sort) <(cd "$2" && find . -name '*.vdb' | sort) || { echo "other fields"; exit 1; }
  while read -r name; do
    size=$(stat -c %s "$1/$name")
    ((size == $(stat -c %s "$2/$name"))) && cmp -i "$identifier_end" -n $((size - identifier_end - checksum)) \
      "$1/$name" "$2/$name" || { echo "$name differs"; exit 1; }
  done < <(cd "$1" && find . -name '*.vdb')
}

# wait_for SECONDS COMMAND...: until the command succeeds.
wait_for() {
  local end=$((SECONDS + $1))
  shift
  until "$@"; do
    ((SECONDS < end)) || { echo "still not after a while: $*"; return 1; }
    sleep 0.05
  done
}
