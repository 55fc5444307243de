#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Draws docs/slice.png: a cut through the double layer method's field of Debian's bunny, every pixel a `bilayer query`.
# Needs ./run build, and the packages glmark2-data and chromium.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

mesh=/usr/share/glmark2/models/bunny.obj
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
build/release/bilayer build "$mesh" -o "$work/bunny.vdb" --resolution 64 --half-width 4 --method double-layer >/dev/null

# the cut z = 0.1 through the mesh's bounds, 700 pixels wide
awk 'BEGIN { for (j = 0; j < 600; ++j) for (i = 0; i < 700; ++i) print -1.2 + i / 300, 0.95 - j / 300, 0.1 }' |
  build/release/bilayer query "$work/bunny.vdb" >"$work/samples"
{
  printf '<canvas id=c width=700 height=600></canvas><style>body{margin:0}</style><script>const s=`'
  awk '{ print $1, $5 }' "$work/samples"
  cat <<'HTML'
`.trim().split('\n'), g = c.getContext('2d'), p = g.createImageData(700, 600), h = 2 / 64;
s.forEach((line, k) => {
  const [d, inBand] = line.split(' ').map(Number), v = d / h, near = Math.exp(-25 * v * v);
  const ring = 0.86 + 0.14 * Math.cos(2 * Math.PI * v);
  let rgb = inBand ? (v < 0 ? [61, 126, 166] : [209, 140, 110]).map(x => 255 - (255 - x) * (0.35 + 0.16 * Math.abs(v))) 
                   : v < 0 ? [43, 70, 92] : [251, 250, 247];
  if (inBand) rgb = rgb.map(x => x * ring * (1 - near) + 30 * near);
  rgb.concat(255).forEach((x, i) => p.data[4 * k + i] = x);
});
g.putImageData(p, 0, 0);
</script>
HTML
} >"$work/slice.html"
chromium --headless --no-sandbox --disable-background-networking --no-first-run --hide-scrollbars --window-size=700,600 \
  --user-data-dir="$work/profile" --screenshot=docs/slice.png "file://$work/slice.html" >/dev/null 2>&1
