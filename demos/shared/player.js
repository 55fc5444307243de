// SPDX-License-Identifier: Apache-2.0
// Plays a recording of bodies. While time runs, each frame is drawn once. While it stands still, frames with moved
// lights and shifted pixels are averaged: soft shadows, light from the whole sky, smooth edges.
// In the address, "#still&t=2.5&samples=48" draws one such picture before the page counts as loaded; t is in seconds, or
// "end". Without it the picture is of the moment that the recording names. "&width=1600&height=1000" are the pixels of
// a screenshot, where the window that takes it is smaller by its frame.
'use strict';

const SAMPLES = 160;           // averaged in the picture of a pause: beyond this nothing changes to the eye
const FADE = [12, 40];         // samples over which that picture replaces the plain one: earlier ones are too rough
const SPEEDS = [1, 0.5, 0.25, 0.1, 2];

// ---- the camera ----------------------------------------------------------------------------------------------------

const camera = new THREE.PerspectiveCamera(26, 1);
camera.up.set(0, 0, 1);
const controls = new THREE.OrbitControls(camera, canvas);
controls.enableDamping = true;
controls.dampingFactor = 0.12;
controls.maxPolarAngle = 1.53;
controls.enableKeys = false;
function resetView() {
  const view = recording.view, azimuth = +(options.get('azimuth') || view.azimuth), up = +(options.get('elevation') || view.elevation);
  const aside = Math.max(1, 1.25 / camera.aspect);  // a tall window needs a step back
  controls.target.copy(vector(view.target));
  camera.position.set(Math.cos(up) * Math.cos(azimuth), Math.cos(up) * Math.sin(azimuth), Math.sin(up))
    .multiplyScalar(view.distance * aside).add(controls.target);
  controls.minDistance = 0.15 * view.distance;
  controls.maxDistance = 3 * view.distance;
  camera.near = 0.006 * view.distance;
  camera.far = 30 * view.distance;
  camera.updateProjectionMatrix();
  controls.update();
}

// ---- drawing -------------------------------------------------------------------------------------------------------

const flat = new THREE.OrthographicCamera(-1, 1, 1, -1, 0, 1);
const quad = new THREE.Mesh(new THREE.PlaneBufferGeometry(2, 2));
quad.frustumCulled = false;
function pass(fragment, uniforms) {
  return new THREE.ShaderMaterial({ uniforms, depthTest: false, depthWrite: false,
    vertexShader: 'varying vec2 at; void main() { at = uv; gl_Position = vec4(position.xy, 0., 1.); }',
    fragmentShader: 'varying vec2 at;\n' + fragment });
}
function run(material, target) {
  quad.material = material;
  renderer.setRenderTarget(target);
  renderer.render(quad, flat);
}

const average = pass(`uniform sampler2D before, latest; uniform float weight;
  void main() { gl_FragColor = mix(texture2D(before, at), texture2D(latest, at), weight); }`,
  { before: { value: null }, latest: { value: null }, weight: { value: 1 } });

// Lays the picture over a gradient, then goes from light to display: a filmic curve (K. Narkowicz's fit of ACES), sRGB.
const present = pass(`uniform sampler2D plain, averaged; uniform float part, aspect;
  vec3 toLinear(vec3 c) { return pow(c, vec3(2.2)); }
  vec3 filmic(vec3 x) { return clamp(x * (2.51 * x + .03) / (x * (2.43 * x + .59) + .14), 0., 1.); }
  float noise(vec2 p) { return fract(sin(dot(p, vec2(12.9898, 78.233))) * 43758.5453); }
  void main() {
    vec4 picture = mix(texture2D(plain, at), texture2D(averaged, at), part);
    vec2 middle = (at - vec2(.5, .44)) * vec2(min(aspect, 1.6), 1.);
    float glow = exp(-2.6 * dot(middle, middle));
    vec3 backdrop = mix(toLinear(vec3(.700, .745, .790)), toLinear(vec3(.955, .950, .935)), glow);
    vec3 light = filmic(.92 * picture.rgb / max(picture.a, 1e-4)) * picture.a + backdrop * (1. - picture.a);
    vec3 display = mix(12.92 * light, 1.055 * pow(max(light, 1e-5), vec3(1. / 2.4)) - .055, step(.0031308, light));
    gl_FragColor = vec4(display + (noise(gl_FragCoord.xy) - .5) / 255., 1.);
  }`, { plain: { value: null }, averaged: { value: null }, part: { value: 0 }, aspect: { value: 1 } });

let targets = null, taken = 0;
function resize() {
  const width = +options.get('width') || innerWidth, height = +options.get('height') || innerHeight;
  renderer.setPixelRatio(Math.min(devicePixelRatio || 1, 2));
  renderer.setSize(width, height, false);
  const size = renderer.getDrawingBufferSize(new THREE.Vector2());
  if (targets) Object.values(targets).forEach(target => target.dispose());
  // a stencil buffer is asked for because three.js then gives 24 bits of depth instead of 16
  const plainFormat = { type: THREE.HalfFloatType, format: THREE.RGBAFormat, minFilter: THREE.LinearFilter, stencilBuffer: true };
  const exactFormat = { type: THREE.FloatType, format: THREE.RGBAFormat, minFilter: THREE.NearestFilter,
                        magFilter: THREE.NearestFilter, depthBuffer: false };
  targets = { plain: new THREE.WebGLMultisampleRenderTarget(size.x, size.y, plainFormat),
              single: new THREE.WebGLRenderTarget(size.x, size.y, plainFormat),
              before: new THREE.WebGLRenderTarget(size.x, size.y, exactFormat),
              after: new THREE.WebGLRenderTarget(size.x, size.y, exactFormat) };
  camera.aspect = width / height;
  camera.updateProjectionMatrix();
  restart();
}
function restart() { taken = 0; }

// The plain picture: shadows of the key light and of a sky that stands in the zenith.
function drawPlain() {
  aim(key, vector(KEY.from));
  aim(sky, new THREE.Vector3(0.05, 0.1, 1));
  key.intensity = KEY.intensity;
  sky.intensity = 0.42 * SKY.intensity;
  ambient.intensity = 0.42;
  camera.clearViewOffset();
  renderer.shadowMap.needsUpdate = true;
  renderer.setRenderTarget(targets.plain);
  renderer.render(scene, camera);
}

// Low-discrepancy numbers: the additive recurrence of the generalized golden ratio in five dimensions.
const STEP = [0.8566748838545029, 0.733891856627126, 0.6287067210378087, 0.5385972572236101, 0.4614019054];
function drawSample() {
  const [a, b, c, d, e] = STEP.map(step => (0.5 + step * (taken + 1)) % 1);
  const towardsKey = vector(KEY.from).normalize(), side = new THREE.Vector3(0, 0, 1).cross(towardsKey).normalize();
  const radius = KEY.spread * Math.sqrt(a), turn = 2 * Math.PI * b;
  aim(key, towardsKey.clone().addScaledVector(side, radius * Math.cos(turn))
    .addScaledVector(side.cross(towardsKey), radius * Math.sin(turn)));
  const z = SKY.lowest + (1 - SKY.lowest) * c, flatPart = Math.sqrt(1 - z * z), azimuth = 2 * Math.PI * d;
  aim(sky, new THREE.Vector3(flatPart * Math.cos(azimuth), flatPart * Math.sin(azimuth), z));
  key.intensity = KEY.intensity;
  sky.intensity = SKY.intensity;
  ambient.intensity = 0.13;

  const size = renderer.getDrawingBufferSize(new THREE.Vector2());
  camera.setViewOffset(size.x, size.y, e - 0.5, (a * 7 + d) % 1 - 0.5, size.x, size.y);
  renderer.shadowMap.needsUpdate = true;
  renderer.setRenderTarget(targets.single);
  renderer.render(scene, camera);
  average.uniforms.before.value = targets.before.texture;
  average.uniforms.latest.value = targets.single.texture;
  average.uniforms.weight.value = 1 / (taken + 1);
  run(average, targets.after);
  [targets.before, targets.after] = [targets.after, targets.before];
  ++taken;
}

function show(part) {
  present.uniforms.plain.value = targets.plain.texture;
  present.uniforms.averaged.value = targets.before.texture;
  present.uniforms.part.value = part;
  present.uniforms.aspect.value = camera.aspect;
  run(present, null);
}

// ---- time ----------------------------------------------------------------------------------------------------------

let time = 0, playing = false, speed = 0;
const nextPosition = new THREE.Vector3(), nextRotation = new THREE.Quaternion();
function setTime(t) {
  time = Math.min(Math.max(t, 0), duration);
  let low = 0, high = times.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle; else high = middle;
  }
  const part = high > low ? Math.min(Math.max((time - times[low]) / (times[high] - times[low]), 0), 1) : 0;
  bodies.forEach((mesh, body) => {
    readPose(low, body, mesh.position, mesh.quaternion);
    readPose(high, body, nextPosition, nextRotation);
    mesh.position.lerp(nextPosition, part);
    mesh.quaternion.slerp(nextRotation, part);
  });
  showSurfaces(part < 1 ? low : high);
  scene.updateMatrixWorld();
  restart();
  $('scrub').value = duration > 0 ? time / duration : 1;
  $('scrub').style.setProperty('--done', 100 * $('scrub').value + '%');
  $('clock').textContent = time.toFixed(2) + ' / ' + duration.toFixed(2) + ' s';
}
function setPlaying(on) {
  playing = on;
  if (on && time >= duration) setTime(0);
  document.querySelector('#play path').setAttribute('d', on ? 'M3 1h4v14H3zM9 1h4v14H9z' : 'M3 1l11 7-11 7z');
}
function setSpeed(index) {
  speed = index % SPEEDS.length;
  $('speed').textContent = SPEEDS[speed] + '\u00d7';
}

// ---- the page ------------------------------------------------------------------------------------------------------

$('title').textContent = recording.title;
document.title = 'bilayer: ' + recording.title;
for (const [label, value] of recording.notes) {
  $('notes').append(Object.assign(document.createElement('dt'), { textContent: label }),
                    Object.assign(document.createElement('dd'), { textContent: value }));
}
$('play').onclick = () => setPlaying(!playing);
$('speed').onclick = () => setSpeed(speed + 1);
$('scrub').oninput = () => { setPlaying(false); setTime($('scrub').value * duration); };
addEventListener('resize', resize);
addEventListener('keydown', event => {
  const step = (event.shiftKey ? 1 : 0.1) * (event.key === 'ArrowLeft' ? -1 : 1);
  if (event.key === ' ') setPlaying(!playing);
  else if (event.key === 'ArrowLeft' || event.key === 'ArrowRight') { setPlaying(false); setTime(time + step); }
  else if (event.key === 'Home') setTime(0);
  else if (event.key === 'End') { setPlaying(false); setTime(duration); }
  else return;
  event.preventDefault();
});
controls.addEventListener('change', restart);

// the play button takes no space bar of its own, or it would toggle twice
$('play').onkeydown = event => { if (event.key === ' ') event.preventDefault(); };
$('play').onkeyup = event => event.preventDefault();

setTime(duration);
const extent = new THREE.Box3();
bodies.forEach(mesh => extent.expandByObject(mesh));
changing.forEach(body => extent.expandByObject(body.mesh));
stage = extent.getBoundingSphere(new THREE.Sphere());
setSpeed(0);
resize();
resetView();

if (options.has('still')) {
  setPlaying(false);
  const moment = options.get('t') || recording.view.moment;
  setTime(moment === undefined || moment === 'end' ? duration : +moment);
  for (const samples = +(options.get('samples') || 48); taken < samples;) drawSample();
  show(1);
  // a plain image in place of the canvas: a screenshot may be taken before the browser composites WebGL
  const still = Object.assign(document.createElement('canvas'), { width: canvas.width, height: canvas.height });
  still.getContext('2d').drawImage(canvas, 0, 0);
  canvas.replaceWith(still);
} else {
  setTime(0);
  setPlaying(true);
  let last = performance.now();
  const tick = now => {
    requestAnimationFrame(tick);
    const passed = Math.min((now - last) / 1000, 0.1);
    last = now;
    controls.update();
    if (playing) {
      setTime(time + passed * SPEEDS[speed]);
      if (time >= duration) setPlaying(false);
    }
    if (taken >= SAMPLES) return;
    if (taken === 0) drawPlain();
    if (!playing) drawSample();
    show(Math.min(Math.max((taken - FADE[0]) / (FADE[1] - FADE[0]), 0), 1));
  };
  requestAnimationFrame(tick);
}
