#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Plays a scene, then takes its picture with headless Chromium: show.sh NAME [OPTIONS of the program]. It exits with 3 if
# a criterion is missed, as the program does.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

name=$1
shift
program=build/release/demo_$name
out=out
for ((i = 1; i <= $#; ++i)); do
  case "${!i}" in
    --out) next=$((i + 1)); out=${!next:-out} ;;
    --out=*) out=${!i#--out=} ;;
    -h | --help) exec "$program" --help ;;
  esac
done

start=$(mktemp)
profile=$(mktemp -d) # of its own, so that the browser starts although another one is open
trap 'rm -rf "$profile" "$start"' EXIT
status=0
"$program" "$@" || status=$?
((status == 0 || status == 3)) || exit "$status"

echo "taking the picture $out/$name.png with Chromium: seconds on an idle machine, minutes on a busy one" >&2
rm -f "$out/$name.png"
page=$(realpath "$out/$name.html")
chromium --headless --no-sandbox --use-angle=swiftshader --enable-unsafe-swiftshader --disable-quic --no-first-run \
  --disable-background-networking --disable-component-update --disable-sync --hide-scrollbars --window-size=1600,1000 \
  --user-data-dir="$profile" --screenshot="$(realpath "$out")/$name.png" "file://$page#still&samples=32&width=1600&height=1000" \
  >"$profile/log" 2>&1 || true
if [[ ! -s $out/$name.png ]]; then
  echo "show.sh: Chromium took no picture of $page; its last words:" >&2
  tail -n 5 "$profile/log" >&2
  exit 1
fi

echo "files"
find "$out" -maxdepth 1 -type f -newer "$start" | sort | sed 's/^/  /'
exit "$status"
