// SPDX-License-Identifier: Apache-2.0
// What a recording shows: its meshes and poses, the lights and the ground.
'use strict';

const KEY = { colour: 0xffeedd, intensity: 1.75, from: [-0.75, -0.45, 1.25], spread: 0.13 };
const SKY = { colour: 0xdce8f8, intensity: 1.15, lowest: 0.12 };  // sine of the lowest elevation that shines
const SHADOW_TEXELS = 2048;
const CASTER_CELLS = 32;       // along the radius of a mesh: finer than the shadows' edges are soft
const CASTER_TRIANGLES = 2e4;  // meshes below this throw their shadows themselves

const $ = id => document.getElementById(id);
const recording = JSON.parse($('data').textContent);
const buffer = text => Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer;
const vector = v => new THREE.Vector3(v[0], v[1], v[2]);
const linear = colour => new THREE.Color(colour).convertSRGBToLinear();
const options = new URLSearchParams(location.hash.slice(1));

function fail(message) {
  $('trouble').textContent = message;
  $('trouble').style.display = 'grid';
  throw new Error(message);
}

// ---- the recording -------------------------------------------------------------------------------------------------

const times = new Float32Array(buffer(recording.times));
const positions = new Uint16Array(buffer(recording.positions));
const rotations = new Int16Array(buffer(recording.rotations));
const count = recording.bodies.length;
const duration = times[times.length - 1];

function readPose(frame, body, position, rotation) {
  const p = 3 * (frame * count + body), r = 4 * (frame * count + body);
  for (let i = 0; i < 3; ++i)
    position.setComponent(i, recording.lower[i] + positions[p + i] / 65535 * recording.size[i]);
  rotation.set(rotations[r], rotations[r + 1], rotations[r + 2], rotations[r + 3]).normalize();
}

function readGeometry(mesh) {
  const steps = new Uint16Array(buffer(mesh.points));
  const points = new Float32Array(steps.length);
  for (let i = 0; i < steps.length; ++i) points[i] = mesh.lower[i % 3] + steps[i] / 65535 * mesh.size[i % 3];
  const indices = new (mesh.indexBits === 16 ? Uint16Array : Uint32Array)(buffer(mesh.indices));
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(points, 3));
  geometry.setIndex(new THREE.BufferAttribute(indices, 1));
  geometry.computeVertexNormals();
  return geometry;
}

// The numbers of a list that keeps each in as few bytes as it needs.
function readNumbers(text) {
  const bytes = new Uint8Array(buffer(text)), numbers = new Uint32Array(bytes.length);
  let count = 0;
  for (let i = 0; i < bytes.length; ++i, ++count)
    for (let shift = 0;; ++i, shift += 7) {
      numbers[count] |= (bytes[i] & 127) << shift;
      if (bytes[i] < 128) break;
    }
  return numbers.subarray(0, count);
}

// A frame of a surface that changes: steps from point to point, and how far back each corner's point stands.
function readChanging(frame) {
  const steps = readNumbers(frame.points), points = new Float32Array(steps.length), at = [0, 0, 0];
  for (let i = 0; i < steps.length; ++i) {
    at[i % 3] += steps[i] & 1 ? -(steps[i] + 1) / 2 : steps[i] / 2;
    points[i] = frame.lower[i % 3] + at[i % 3] / 4095 * frame.size[i % 3];
  }
  const indices = readNumbers(frame.triangles);
  for (let i = 0, used = 0; i < indices.length; ++i) indices[i] = indices[i] ? used - indices[i] : used++;
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(points, 3));
  geometry.setIndex(new THREE.BufferAttribute(indices, 1));
  geometry.computeVertexNormals();
  return geometry;
}

// A coarse copy that throws the shadows at a part of the cost: the points of each cell of a grid become their mean.
function coarsened(geometry) {
  const points = geometry.attributes.position.array, indices = geometry.index.array;
  if (indices.length / 3 < CASTER_TRIANGLES) return geometry;
  geometry.computeBoundingSphere();
  const cell = geometry.boundingSphere.radius / CASTER_CELLS, cells = new Map(), owner = new Uint32Array(points.length / 3);
  const sums = [];
  for (let i = 0; i < owner.length; ++i) {
    const name = [0, 1, 2].map(axis => Math.round(points[3 * i + axis] / cell)).join();
    if (!cells.has(name)) cells.set(name, sums.push([0, 0, 0, 0]) - 1);
    const sum = sums[owner[i] = cells.get(name)];
    for (let axis = 0; axis < 3; ++axis) sum[axis] += points[3 * i + axis];
    ++sum[3];
  }
  const kept = [];
  for (let i = 0; i < indices.length; i += 3) {
    const [a, b, c] = [owner[indices[i]], owner[indices[i + 1]], owner[indices[i + 2]]];
    if (a !== b && b !== c && c !== a) kept.push(a, b, c);
  }
  const coarse = new THREE.BufferGeometry();
  coarse.setAttribute('position', new THREE.Float32BufferAttribute(sums.flatMap(([x, y, z, n]) => [x / n, y / n, z / n]), 3));
  coarse.setIndex(kept);
  return coarse;
}

// ---- the scene -----------------------------------------------------------------------------------------------------

const canvas = $('canvas');
const context = canvas.getContext('webgl2', { antialias: false, alpha: false, preserveDrawingBuffer: true,
                                              powerPreference: 'high-performance' });
if (!context) fail('This recording needs WebGL 2, which this browser does not offer.');
const renderer = new THREE.WebGLRenderer({ canvas, context });
if (!renderer.extensions.get('EXT_color_buffer_float')) fail('This recording needs EXT_color_buffer_float, which this browser does not offer.');
renderer.extensions.get('OES_texture_float_linear');
renderer.shadowMap.enabled = true;
// averaged samples need no softening of their own
renderer.shadowMap.type = options.has('still') ? THREE.BasicShadowMap : THREE.PCFSoftShadowMap;
renderer.shadowMap.autoUpdate = false;
renderer.setClearColor(0x000000, 0);

// What glazed surfaces mirror: a bright room with two soft boxes and a window.
function studio() {
  const room = new THREE.Scene();
  const panel = (colour, strength, width, height, at) => {
    const light = new THREE.Mesh(new THREE.PlaneBufferGeometry(width, height),
                                 new THREE.MeshBasicMaterial({ color: linear(colour).multiplyScalar(strength), side: THREE.DoubleSide }));
    light.position.set(...at);
    light.lookAt(0, 0, 0);
    room.add(light);
  };
  const dome = new THREE.SphereBufferGeometry(20, 32, 24);
  const colours = [], floor = linear(0x8f8a86), horizon = linear(0xc9d3dc), zenith = linear(0x9fb6cf), c = new THREE.Color();
  for (let i = 0; i < dome.attributes.position.count; ++i) {
    const z = dome.attributes.position.getZ(i) / 20;
    c.copy(horizon).lerp(z < 0 ? floor : zenith, Math.min(1, Math.abs(z) * 1.6));
    colours.push(c.r, c.g, c.b);
  }
  dome.setAttribute('color', new THREE.Float32BufferAttribute(colours, 3));
  room.add(new THREE.Mesh(dome, new THREE.MeshBasicMaterial({ vertexColors: THREE.VertexColors, side: THREE.BackSide })));
  panel(0xfff1e0, 9, 5, 5, [-7, -4, 10]);
  panel(0xe4efff, 4, 3, 8, [10, 3, 5]);
  panel(0xffffff, 3, 10, 2, [0, 11, 6]);
  const eye = new THREE.CubeCamera(0.1, 50, 256, { format: THREE.RGBAFormat, type: THREE.HalfFloatType, generateMipmaps: true,
                                                   minFilter: THREE.LinearMipmapLinearFilter });
  eye.update(renderer, room);
  return eye.renderTarget.texture;
}

const scene = new THREE.Scene();
const geometries = recording.meshes.map(readGeometry);
const casters = geometries.map(coarsened);
const unseen = new THREE.MeshBasicMaterial({ colorWrite: false, depthWrite: false, depthTest: false });
const mirrored = studio();
function materialOf(body) {
  const material = new THREE.MeshPhysicalMaterial({
    color: linear(body.colour), roughness: body.roughness, metalness: body.metalness, clearcoat: body.clearcoat,
    clearcoatRoughness: 0.3, transparent: body.opacity < 1, opacity: body.opacity, envMap: mirrored, envMapIntensity: 0.42 });
  if (!body.clear) return material;
  // What is clear lets light through but mirrors all the same, by Schlick's fit of Fresnel's equations for water.
  material.envMapIntensity = 0.75;
  material.premultipliedAlpha = true;
  material.onBeforeCompile = shader => {
    shader.fragmentShader = shader.fragmentShader
      .replace('gl_FragColor = vec4( outgoingLight, diffuseColor.a );', `
        float fresnel = .02 + .98 * pow(1. - saturate(dot(normal, normalize(vViewPosition))), 5.);
        vec3 mirrored = reflectedLight.directSpecular + reflectedLight.indirectSpecular;
        float cover = mix(diffuseColor.a, 1., fresnel);
        gl_FragColor = vec4((outgoingLight - mirrored) * diffuseColor.a * (1. - fresnel) + mirrored, cover);`)
      .replace('#include <premultiplied_alpha_fragment>', '');
  };
  return material;
}
const bodies = recording.bodies.map(body => {
  const mesh = new THREE.Mesh(geometries[body.mesh], materialOf(body));
  mesh.receiveShadow = true;
  if (body.clear) {
    mesh.renderOrder = 2;
    scene.add(mesh);
    return mesh;
  }
  const caster = new THREE.Mesh(casters[body.mesh], unseen);
  caster.castShadow = true;
  scene.add(mesh.add(caster));
  return mesh;
});

// Bodies whose surface is read anew where a frame begins; glass is drawn over them.
const changing = (recording.changing || []).map(body => {
  const mesh = new THREE.Mesh(new THREE.BufferGeometry(), materialOf(body));
  mesh.receiveShadow = !body.clear;
  mesh.castShadow = !body.clear;
  mesh.renderOrder = 1;
  scene.add(mesh);
  return { mesh, frames: body.frames, shown: -1 };
});
function showSurfaces(frame) {
  for (const body of changing) {
    if (body.shown === frame) continue;
    body.mesh.geometry.dispose();
    body.mesh.geometry = readChanging(body.frames[frame]);
    body.shown = frame;
  }
}

const shadows = new THREE.ShadowMaterial({ color: linear(0x1d2838), opacity: 0.62 });
shadows.depthWrite = false;
const ground = new THREE.Mesh(new THREE.PlaneBufferGeometry(200, 200), shadows);
ground.position.z = recording.view.ground;
ground.receiveShadow = true;
scene.add(ground);

function addLight(colour) {
  const light = new THREE.DirectionalLight(linear(colour));
  light.castShadow = true;
  light.shadow.mapSize.set(SHADOW_TEXELS, SHADOW_TEXELS);
  scene.add(light, light.target);
  return light;
}
const key = addLight(KEY.colour), sky = addLight(SKY.colour);
const ambient = new THREE.HemisphereLight(linear(0xdfeaf8), linear(0xb9a594), 0);
ambient.position.set(0, 0, 1);
scene.add(ambient);

// The ball around the last frame, into which shadow maps are fitted: there they must be sharp.
let stage;
function aim(light, direction) {
  const { center, radius } = stage, box = light.shadow.camera;
  light.target.position.copy(center);
  light.position.copy(center).addScaledVector(direction.normalize(), 4 * radius);
  box.left = box.bottom = -radius;
  box.right = box.top = radius;
  box.near = 0.1 * radius;
  box.far = 14 * radius;  // low light throws long shadows on the ground
  box.updateProjectionMatrix();
  light.shadow.radius = 1.5;
  light.shadow.bias = -0.0005;
  light.target.updateMatrixWorld();
}

