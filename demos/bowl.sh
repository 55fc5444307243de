#!/usr/bin/env bash
# Runs the bowl demo, then takes its picture with headless Chromium. Arguments go to the program.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

out=out
for ((i = 1; i <= $#; ++i)); do
  case "${!i}" in
    --out) next=$((i + 1)); out=${!next:-out} ;;
    --out=*) out=${!i#--out=} ;;
    -h | --help) exec build/release/bowl --help ;;
  esac
done

build/release/bowl "$@"

# A profile of its own lets the browser start beside one that is open already.
profile=$(mktemp -d)
trap 'rm -rf "$profile"' EXIT
rm -f "$out/bowl.png"
page=$(realpath "$out/bowl.html")
chromium --headless --no-sandbox --use-angle=swiftshader --enable-unsafe-swiftshader --disable-quic --no-first-run \
  --disable-background-networking --disable-component-update --disable-sync --hide-scrollbars --window-size=1600,1000 \
  --user-data-dir="$profile" --screenshot="$(realpath "$out")/bowl.png" "file://$page#still&t=end&samples=32" \
  >"$profile/log" 2>&1 || true
if [[ ! -s $out/bowl.png ]]; then
  echo "bowl.sh: Chromium took no picture of $page; its last words:" >&2
  tail -n 5 "$profile/log" >&2
  exit 1
fi

echo "files"
for file in "$out"/*.vdb "$out/bowl.html" "$out/bowl.png"; do printf '  %s\n' "$file"; done
