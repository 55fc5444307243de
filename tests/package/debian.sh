#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# usage: debian.sh DIR: installs the packages in DIR into a clean Debian 12 root, and uses them there as users do: the command
# line, a program by CMake and one by pkg-config, the Python module, and all that the pages of
# docs/start tell. Exits with 4 where no root can be made.
set -euo pipefail
. "$(dirname "$0")/functions.sh"
packages=$(cd "${1:?"the folder of the packages"}" && pwd)
compgen -G "$packages/*.deb" >/dev/null || { echo "debian.sh: no packages in $packages"; exit 1; }
make_root

mkdir -p "$root/packages" "$root/user" "$root/source/docs/start" "$root/source/tests"
cp "$source/run" "$root/source/"
cp "$source"/docs/start/*.md "$root/source/docs/start/"
cp -r "$source/tests/docs" "$root/source/tests/"
cp "$packages"/*.deb "$root/packages/"
cp -r "$source/tests/package/consumer" "$root/user/"
cp "$source/tests/package/parent/main.cpp" "$root/user/cube.cpp"
# the notices that the packages must have: of what docs/third-party.md says is compiled in
mkdir "$root/notices"
sed -n '/^## Compiled in/,/^## Used/s/^|[^|]*|\([^|]*\)|.*/\1/p' "$source/docs/third-party.md" | grep -o '`[^`]*`' | tr -d '`' |
  while read -r package; do cp -L "/usr/share/doc/$package/copyright" "$root/notices/$package"; done
(($(ls "$root/notices" | wc -l) >= 15)) || { echo "debian.sh: docs/third-party.md lists too few packages as compiled in"; exit 1; }
in_root <<'IN_ROOT'
cd /user
apt-get update -qq
install() { apt-get install -y -qq --no-install-recommends "$@" >/tmp/apt.log 2>&1 || { cat /tmp/apt.log; exit 1; }; }

echo "== the command line, with what it depends on alone"
install /packages/bilayer_*.deb
bilayer --version
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n' >tetrahedron.obj
bilayer build tetrahedron.obj -o tetrahedron.vdb --resolution 32 --body
bilayer info tetrahedron.vdb
bilayer devices

echo "== the Python module"
install /packages/python3-bilayer_*.deb
python3 -c 'import bilayer; print(bilayer.__version__, bilayer.Field(bilayer.build(bilayer.box(), resolution=8)).sample([0, 0, 0]).distance)'

echo "== a program by CMake, and one by pkg-config"
install /packages/libbilayer-dev_*.deb g++ cmake make pkg-config
cmake -S consumer -B build >/dev/null
cmake --build build >/dev/null
build/consumer
g++ -std=c++20 cube.cpp $(pkg-config --cflags --libs bilayer-sdf) -o cube
./cube

echo "== the licence, the notices of what is compiled in, and the changelog"
python3 - <<'PYTHON'
from pathlib import Path
for package in ("bilayer", "libbilayer-dev", "python3-bilayer"):
    text = Path(f"/usr/share/doc/{package}/copyright").read_text()
    missing = [notice.name for notice in sorted(Path("/notices").iterdir()) if notice.read_text() not in text]
    assert "Apache License" in text and not missing, f"the copyright of {package} lacks the notices of {missing}"
PYTHON

for package in bilayer libbilayer-dev python3-bilayer; do
  zcat /usr/share/doc/$package/changelog.Debian.gz | grep -qx 'bilayer (.*) bookworm; urgency=medium'
done

echo "== the pages of docs/start"
apt-get purge -y -qq bilayer libbilayer-dev python3-bilayer >/dev/null 2>&1
install sudo
mkdir /scratch
do_page() { # PAGE [OPTIONS...]
  echo "$@"
  python3 /source/tests/docs/run_page.py "${@:2}" --packages /packages /source /nowhere /scratch "docs/start/$1.md"
}
do_page install --from "As Debian packages" --until "Remove an installation from the sources"
for page in field bullet liquid python contacts; do do_page $page; done
do_page install --from "Remove the packages"

echo "== removed without a trace"
left=$(find / -xdev -name '*bilayer*' -not -path '/packages/*' -not -path '/proc/*' -not -path '/var/*' -not -path '/user/*' \
  -not -path '/source/*' -not -path '/scratch/*')
[[ -z $left ]] || { echo "debian.sh: left behind: $left"; exit 1; }
IN_ROOT
echo "the packages work in a clean Debian 12"
