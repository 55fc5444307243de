#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Follows the pages of docs/start in a clean Debian 12 root, from the sources: all ways to install and remove that
# docs/start/install.md tells, and the other pages. No command is replaced. It compiles everything, and takes half an hour. Exits with 4 where no root can be made.
set -euo pipefail
. "$(dirname "$0")/functions.sh"
make_root
copy_sources "$root/bilayer"
in_root <<'IN_ROOT'
apt-get update -qq
apt-get install -y -qq --no-install-recommends sudo python3 >/dev/null
do_page() { # PAGE [OPTIONS...]
  echo "$@"
  python3 /bilayer/tests/docs/run_page.py "${@:2}" --checkout /bilayer /nowhere /scratch "docs/start/$1.md"
}
removed() { [[ -z $(command -v bilayer) ]] || { echo "sources.sh: bilayer is still installed"; exit 1; }; }
do_page install --until "Into a folder of your own"
for page in field bullet liquid python contacts; do do_page $page; done
do_page install --from "Look whether it works" --until "Remove the packages"
removed
do_page install --from "Into a folder of your own" --until "As Debian packages"
"$(echo /scratch/docs-start-install/*/bilayer)/bin/bilayer" --version
do_page install --from "As Debian packages" --until "Remove an installation from the sources"
do_page install --from "Remove the packages"
removed
IN_ROOT
echo "the pages work in a clean Debian 12, by the sources"
