#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# tiles_mpi.sh BILAYER BILAYER_MPI FOLDER: the tiles of 1, 2 and 4 ranks have the same bytes as those of one process.
source "$(dirname "$0")/batch_shared.sh"
need mpirun cmp awk
bilayer=$1 ranks=$2 work=$3
rm -rf "$work" && mkdir -p "$work" && cd "$work"
make_library meshes 1
mesh=meshes/b/0.obj
options=(--resolution 150 --tiles 3x2x2 --sign normals --json)
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
"$bilayer" build "$mesh" -o one "${options[@]}" >one.json
for count in 1 2 4; do
  mpirun --oversubscribe -n "$count" "$ranks" build "$mesh" -o "ranks$count" "${options[@]}" >"ranks$count.json"
  require_same one "ranks$count"
done
"$bilayer" merge ranks4 -o ranks4.vdb >/dev/null
"$bilayer" build "$mesh" -o whole.vdb --resolution 150 --sign normals >/dev/null
diff <("$bilayer" info --json ranks4.vdb) <("$bilayer" info --json whole.vdb)
# a clean mesh, and two boxes that overlap: normals contradict each other, and all ranks build again by winding numbers
awk '/^v/ { v[n++] = $2 " " $3 " " $4; print } /^f/ { f[m++] = $2 " " $3 " " $4 " " $5; print }
  END { for (i = 0; i < n; ++i) { split(v[i], p, " "); print "v", p[1] + 0.43, p[2] + 0.37, p[3] + 0.51 }
        for (i = 0; i < m; ++i) { split(f[i], c, " "); print "f", c[1] + n, c[2] + n, c[3] + n, c[4] + n } }' "$mesh" >two.obj
cp "$mesh" clean.obj
for name in clean two; do
  for sign in auto winding; do
    "$bilayer" build $name.obj -o whole.vdb --resolution 150 --sign $sign >/dev/null
    for count in 1 2 4; do
      folder=$name$sign$count
      mpirun --oversubscribe -n "$count" "$ranks" build $name.obj -o "$folder" --resolution 150 --tiles 2x2x2 --sign $sign \
        --json >"$folder.json"
      require_same "${name}${sign}1" "$folder"
    done
    "$bilayer" merge "$folder" -o merged.vdb >/dev/null
    diff <("$bilayer" info --json merged.vdb) <("$bilayer" info --json whole.vdb)
  done
done
# an open box that overlaps a closed one, by floods with a small and a large ball
for gap in 2 20; do
  awk '!/^f 5 6 8 7/' two.obj >open.obj
  "$bilayer" build open.obj -o whole.vdb --resolution 150 --sign flood --gap $gap >/dev/null
  for count in 1 2 4; do
    folder=open$gap.$count
    mpirun --oversubscribe -n "$count" "$ranks" build open.obj -o "$folder" --resolution 150 --tiles 3x2x2 --sign flood \
      --gap $gap --json >"$folder.json"
    require_same "open$gap.1" "$folder"
  done
  "$bilayer" merge "$folder" -o merged.vdb >/dev/null
  diff <("$bilayer" info --json merged.vdb) <("$bilayer" info --json whole.vdb)
done
# an error of one rank ends all of them
if mpirun --oversubscribe -n 2 "$ranks" build "$mesh" -o refused --resolution 150 --tiles 90x2x2 --sign flood \
  2>refused.txt; then exit 1; fi
grep -q "90 tiles along x" refused.txt
