# SPDX-License-Identifier: Apache-2.0
# To be sourced by the tests of packages: what they share. `source` is the folder of the sources.
source=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)

skip() { echo "skipped: $*"; exit 4; }

# copy_sources DIR: the sources as they stand, without what git ignores, into an empty folder.
copy_sources() {
  mkdir -p "$1"
  (cd "$source" && git ls-files -z --cached --others --exclude-standard | tar --create --null --files-from=-) | tar --extract --directory="$1"
}

# Makes `root`, a clean Debian 12 that goes when the script ends. Skips the test where none can be made.
make_root() {
  ((EUID == 0)) || skip "only root can make a root folder"
  command -v mmdebstrap >/dev/null || skip "mmdebstrap is not installed"
  root=$(mktemp -d)
  trap 'rm -rf "$root"' EXIT
  chmod 755 "$root"
  # the sources and proxies of this machine, Debian's alone
  local options=() file
  for file in /etc/apt/apt.conf.d/*proxy* /etc/apt/apt.conf.d/*registry*; do
    [[ ! -f $file ]] || options+=(--aptopt="$file")
  done
  options+=(--variant=minbase --quiet bookworm)
  mmdebstrap --simulate "${options[@]}" "$root/simulated" || skip "mmdebstrap finds no Debian mirror"
  rm -rf "$root/simulated"
  mmdebstrap "${options[@]}" "$root"
  cp -L /etc/resolv.conf /etc/hosts "$root/etc/"
  echo 'APT::Get::Assume-Yes "true";' >"$root/etc/apt/apt.conf.d/yes"
}

# Runs the script on standard input in the root, with nothing of this machine's environment but its proxies.
in_root() {
  chroot "$root" env -i PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/root DEBIAN_FRONTEND=noninteractive \
    LC_ALL=C.UTF-8 http_proxy="${http_proxy:-}" https_proxy="${https_proxy:-}" bash -euo pipefail
}
