#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Draws the pictures of docs/dirty.md: a mesh (backs of faces in orange, open edges in red), the surface of its field, and
# a cut through the field with the mesh's own cut in red. Needs ./run bench corpus, and the packages chromium and
# libjs-three. Arguments: names of pictures, by default all.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# mesh, voxels, axis and place of the cut, where the viewer stands, what is up for him
pictures=(
  'bunny_zipper.ply            128 z 0.45 -1,-1.4,1.6   0,1,0'
  'teapot.obj                  128 z 0.5   1,0.9,2      0,1,0'
  'beetle.obj                  128 z 0.45  1.6,0.7,1    0,1,0'
  'office_chair.obj            128 x 0.5   1.4,-1.6,0.7 0,0,1'
  'cgal-elephant-with-holes.off 128 z 0.5  1,0.3,1.6    0,1,0'
  'cgal-three_knives.off       128 y 0.5   1,-1.4,1.2   0,0,1'
  'casting_inverted.off        128 y 0.5   0.7,1.2,1    0,1,0'
  'cgal-blobby-shuffled.off    128 z 0.5   0.5,0.7,1.5  0,1,0'
  'leoTest1.obj                200 y 0.08  1,1.2,1.4    0,1,0'
  'truck.obj                   128 z 0.5   1,0.6,1.2    0,1,0'
)
three=/usr/share/javascript/three/three.min.js
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

page() {
  printf '<!doctype html><meta charset=utf-8><body><script>'
  cat "$three"
  printf '</script><script>const scene = '
  cat "$1"
  printf ', eye = [%s], up = [%s];' "$2" "$3"
  cat <<'HTML'

const W = 400, H = 380, paper = '#fbfaf7';
const {mesh, surface, slice} = scene;
const out = document.createElement('canvas');
out.width = 3 * W; out.height = H + 30;
const g = out.getContext('2d');
g.fillStyle = paper;
g.fillRect(0, 0, out.width, out.height);

// one camera for mesh and surface; the mesh fills the panel
const box = new THREE.Box3().setFromArray(mesh.points), ball = box.getBoundingSphere(new THREE.Sphere());
const r = ball.radius, camera = new THREE.OrthographicCamera(-1, 1, 1, -1, r, 9 * r);
camera.up.set(...up);
camera.position.set(...eye).normalize().multiplyScalar(5 * r).add(ball.center);
camera.lookAt(ball.center);
camera.updateMatrixWorld();
const seen = new THREE.Box3().setFromArray(mesh.points.flatMap((_, i) => i % 3 ? [] :
  new THREE.Vector3(...mesh.points.slice(i, i + 3)).applyMatrix4(camera.matrixWorldInverse).toArray()));
const middle = seen.getCenter(new THREE.Vector3()), extent = seen.getSize(new THREE.Vector3());
const half = 0.53 * Math.max(extent.y, extent.x * H / W);
[camera.left, camera.right] = [middle.x - half * W / H, middle.x + half * W / H];
[camera.bottom, camera.top] = [middle.y - half, middle.y + half];
camera.updateProjectionMatrix();
const lamp = new THREE.DirectionalLight(0xffffff, 0.75);
lamp.position.set(-0.5, 0.9, 1);
camera.add(lamp);
const renderer = new THREE.WebGLRenderer({antialias: true, preserveDrawingBuffer: true});
renderer.setSize(2 * W, 2 * H);
renderer.setClearColor(paper);

function geometry({points, triangles}) {
  const geo = new THREE.BufferGeometry();
  geo.setAttribute('position', new THREE.BufferAttribute(new Float32Array(points), 3));
  geo.setIndex(new THREE.BufferAttribute(new Uint32Array(triangles), 1));
  return geo;
}
function openEdges({points, triangles}) {
  const uses = new Map();
  for (let i = 0; i < triangles.length; i += 3)
    for (let k = 0; k < 3; ++k) {
      const a = triangles[i + k], b = triangles[i + (k + 1) % 3], key = Math.min(a, b) * 2 ** 26 + Math.max(a, b);
      uses.set(key, (uses.get(key) || 0) + 1);
    }
  const ends = [];
  for (const [key, n] of uses)
    if (n === 1) for (const v of [Math.floor(key / 2 ** 26), key % 2 ** 26]) ends.push(...points.slice(3 * v, 3 * v + 3));
  const geo = new THREE.BufferGeometry();
  geo.setAttribute('position', new THREE.BufferAttribute(new Float32Array(ends), 3));
  return new THREE.LineSegments(geo, new THREE.LineBasicMaterial({color: 0xd01010, linewidth: 3}));
}
function panel(x, title, things) {
  const world = new THREE.Scene();
  world.add(camera, new THREE.AmbientLight(0xffffff, 0.38), ...things);
  renderer.render(world, camera);
  g.drawImage(renderer.domElement, x, 30, W, H);
  label(x, title);
}
function label(x, text) {
  g.fillStyle = '#222';
  g.font = '15px "DejaVu Sans", sans-serif';
  g.fillText(text, x + 10, 22);
}
const matt = (color, side, flat) => new THREE.MeshLambertMaterial({color, side, flatShading: flat});

const faces = geometry(mesh).toNonIndexed();
faces.computeVertexNormals();
panel(0, scene.name, [new THREE.Mesh(faces, matt(0xb9bec4, THREE.FrontSide)),
                      new THREE.Mesh(faces, matt(0xe08a3c, THREE.BackSide)), openEdges(mesh)]);
const skin = geometry(surface);
skin.computeVertexNormals();
panel(W, "its field's surface, signs by " + scene.sign, [new THREE.Mesh(skin, matt(0x6f9fc0, THREE.FrontSide)),
                                       new THREE.Mesh(skin, matt(0xe08a3c, THREE.BackSide))]);

// the cut: a voxel is a square; upright where the mesh is
const uAxis = (slice.axis + 1) % 3, upright = up[uAxis] ? 0 : 1;
const cells = document.createElement('canvas'), pixels = cells.getContext('2d');
[cells.width, cells.height] = upright ? slice.size : [slice.size[1], slice.size[0]];
const image = pixels.createImageData(cells.width, cells.height);
slice.values.forEach((d, i) => {
  const at = [i % slice.size[0], Math.floor(i / slice.size[0])], depth = Math.min(1, Math.abs(d) / 3);
  const rgb = !slice.active[i] ? (d < 0 ? [43, 70, 92] : [251, 250, 247])
    : (d < 0 ? [61, 126, 166] : [209, 140, 110]).map(c => 255 - (255 - c) * (0.3 + 0.6 * depth));
  const pixel = at[1 - upright] + (cells.height - 1 - at[upright]) * cells.width;
  rgb.concat(255).forEach((x, k) => image.data[4 * pixel + k] = x);
});
pixels.putImageData(image, 0, 0);
const scale = Math.min((W - 20) / cells.width, (H - 10) / cells.height);
const left = 2 * W + (W - scale * cells.width) / 2, bottom = 30 + (H + scale * cells.height) / 2;
g.imageSmoothingEnabled = false;
g.drawImage(cells, left, bottom - scale * cells.height, scale * cells.width, scale * cells.height);
const screen = p => {
  const at = [0, 1].map(k => scale * (p[(uAxis + k) % 3] / scene.voxelSize - slice.low[k] + 0.5));
  return [left + at[1 - upright], bottom - at[upright]];
};
const point = i => mesh.points.slice(3 * i, 3 * i + 3);
g.strokeStyle = '#b01010';
g.lineWidth = 1.2;
for (let i = 0; i < mesh.triangles.length; i += 3) {
  const cut = [];
  for (let k = 0; k < 3; ++k) {
    const a = point(mesh.triangles[i + k]), b = point(mesh.triangles[i + (k + 1) % 3]);
    const da = a[slice.axis] - slice.plane, db = b[slice.axis] - slice.plane;
    if ((da < 0) !== (db < 0)) cut.push(a.map((x, n) => x + (b[n] - x) * da / (da - db)));
  }
  if (cut.length === 2) {
    g.beginPath();
    g.moveTo(...screen(cut[0]));
    g.lineTo(...screen(cut[1]));
    g.stroke();
  }
}
label(2 * W, 'a cut: inside blue, outside brown');
let quality = 0.9, picture = out.toDataURL('image/jpeg', quality);
while (picture.length > 100e3 && quality > 0.4) picture = out.toDataURL('image/jpeg', quality -= 0.05);
document.body.textContent = picture;
</script>
HTML
}

mkdir -p docs/dirty
for picture in "${pictures[@]}"; do
  read -r mesh voxels axis at eye up <<<"$picture"
  name=${mesh%.*}
  (($# == 0)) || [[ " $* " == *" $name "* ]] || continue
  build/release/bench_corpus --mesh "$mesh" --resolution "$voxels" --axis "$axis" --at "$at" --scenes "$work" >/dev/null
  page "$work/$name.json" "$eye" "$up" >"$work/page.html"
  chromium --headless --no-sandbox --use-angle=swiftshader --enable-unsafe-swiftshader --disable-background-networking \
    --no-first-run --virtual-time-budget=60000 --user-data-dir="$work/profile" --dump-dom "file://$work/page.html" \
    2>"$work/log" | sed -n 's/.*data:image\/jpeg;base64,\([A-Za-z0-9+\/=]*\).*/\1/p' | base64 -d >"docs/dirty/$name.jpg"
  [[ -s docs/dirty/$name.jpg ]] || { echo "dirty.sh: no picture of $mesh" >&2; tail -n 5 "$work/log" >&2; exit 1; }
done
