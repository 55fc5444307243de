#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# usage: reproduce.sh DIR: builds the packages of DIR again, from a copy of the sources in a folder of another name and without
# a compiler cache, and compares the bytes.
set -euo pipefail
packages=$(cd "${1:?"the folder of the packages"}" && pwd)
. "$(dirname "$0")/functions.sh"
cd "$source"
export SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)}

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
copy=$folder/sources-in-another-folder
copy_sources "$copy"
(cd "$copy" && unset CMAKE_CXX_COMPILER_LAUNCHER && CCACHE_DISABLE=1 ./run package)

same=1
for package in "$packages"/*.deb; do
  again=$copy/build/packages/$(basename "$package")
  cmp "$package" "$again" || same=0
done
((same)) || { echo "reproduce.sh: the packages of two folders differ"; exit 1; }
echo "the packages of two folders have the same bytes"
