"use strict";
// Plays one recording. What it needs stands in the page: #about (JSON) and #data (deflated positions, base64).

const about = JSON.parse(document.getElementById("about").textContent);
const [frames, axes, agents] = about.shape;
const { stage, period, first } = about;
const last = first + (frames - 1) * period;
const $ = id => document.getElementById(id);

// ---------------------------------------------------------------------------------------------------- positions

/** Inflate the data and add the differences up: one Uint16Array, axis by axis, agent by agent, frame by frame. */
async function unpack() {
  const bytes = Uint8Array.from(atob($("data").textContent), c => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const halves = new Uint8Array(await new Response(stream).arrayBuffer());
  const count = halves.length / 2, whole = new Uint16Array(count);
  for (let row = 0; row < count; row += frames)
    for (let f = 0, sum = 0; f < frames; f++)
      whole[row + f] = sum = (sum + halves[row + f] + (halves[count + row + f] << 8)) & 0xffff;
  return whole;
}

/** Position of an agent along an axis at a frame, m; 0 along the third axis of a plane. */
function at(whole, axis, agent, frame) {
  if (axis >= axes) return 0;
  return about.low[axis] + about.quantum[axis] * whole[(axis * agents + agent) * frames + frame];
}

/** Whether an agent went through a periodic face between a frame and the next. */
function leaps(whole, agent, frame) {
  if (about.leap === null) return false;
  for (let axis = 0; axis < axes; axis++)
    if (Math.abs(at(whole, axis, agent, frame + 1) - at(whole, axis, agent, frame)) > about.leap) return true;
  return false;
}

// ------------------------------------------------------------------------------------------------------ colours

/** Colour of a share from 0 to 1, written into `out` from `place` on, each part from 0 to 1. */
function ramp(share, out, place, pale = 0) {
  const x = Math.min(Math.max(share, 0), 1) * (about.ramp.length - 1);
  const i = Math.min(Math.floor(x), about.ramp.length - 2), part = x - i;
  for (let c = 0; c < 3; c++) {
    const tone = (about.ramp[i][c] * (1 - part) + about.ramp[i + 1][c] * part) / 255;
    out[place + c] = linear(tone + (0.92 - tone) * pale);
  }
}

/** sRGB decoded to light, which three.js computes with. */
const linear = c => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
const CHOSEN = [1.0, 0.26, 0.0], ALERT = [0.67, 0.0, 0.03];

// -------------------------------------------------------------------------------------------------------- scene

const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
$("view").prepend(renderer.domElement);
const scene = new THREE.Scene();
scene.background = new THREE.Color(0xffffff);
const sky = new THREE.HemisphereLight(0xffffff, 0x9a9aa4, 2.4);
sky.position.set(0, 0, 1);
scene.add(sky);
const sun = new THREE.DirectionalLight(0xffffff, 1.2);
sun.position.set(-1, -2, 3);
scene.add(sun);

const centre = new THREE.Vector3(...stage.centre), span = stage.span;
const above = new THREE.OrthographicCamera(-1, 1, 1, -1, 0.01 * span, 100 * span);
const beside = new THREE.PerspectiveCamera(45, 1, 0.01 * span, 50 * span);
for (const camera of [above, beside]) camera.up.set(0, 0, 1);
above.up.set(0, 1, 0);
above.position.copy(centre).add(new THREE.Vector3(0, 0, 40 * span));
beside.position.copy(centre).add(new THREE.Vector3(0.7 * span, -2.2 * span, 1.5 * span));
let camera = stage.space ? beside : above, controls;

function useCamera(chosen) {
  controls?.dispose();
  camera = chosen;
  controls = new THREE.OrbitControls(camera, renderer.domElement);
  controls.target.copy(centre);
  controls.enableRotate = camera === beside;
  controls.update();
  $("camera").textContent = camera === beside ? "from above" : "3-D";
  fit();
}

function fit() {
  const { clientWidth: w, clientHeight: h } = $("view");
  if (!w || !h) return;
  renderer.setSize(w, h);
  const half = 1.08 * span / Math.min(1, w / h);
  [above.top, above.bottom] = [half, -half];
  [above.left, above.right] = [-half * w / h, half * w / h];
  beside.aspect = w / h;
  above.updateProjectionMatrix();
  beside.updateProjectionMatrix();
}

for (const [vertices, faces, colour] of stage.solids) {
  const shape = new THREE.BufferGeometry();
  shape.setAttribute("position", new THREE.BufferAttribute(new Float32Array(vertices), 3));
  shape.setIndex(faces);
  const flatly = shape.toNonIndexed();
  flatly.computeVertexNormals();
  const colourOf = new THREE.Color(...colour.map(c => linear(c / 255)));
  scene.add(new THREE.Mesh(flatly, new THREE.MeshLambertMaterial({ color: colourOf, side: THREE.DoubleSide })));
}
for (const [points, colour] of stage.lines) {
  const shape = new THREE.BufferGeometry();
  shape.setAttribute("position", new THREE.BufferAttribute(new Float32Array(points), 3));
  const color = new THREE.Color(...colour.map(c => linear(c / 255)));
  scene.add(new THREE.LineSegments(shape, new THREE.LineBasicMaterial({ color })));
}

/** A dart along +x, as long as 1. */
function dart() {
  const v = [0.6, 0, 0, -0.2, 0, 0], faces = [];
  for (let i = 0; i < 8; i++) {
    const a = i * Math.PI / 4;
    v.push(-0.4, 0.3 * Math.cos(a), 0.18 * Math.sin(a));
    faces.push(0, 2 + i, 2 + (i + 1) % 8, 1, 2 + (i + 1) % 8, 2 + i);
  }
  const shape = new THREE.BufferGeometry();
  shape.setAttribute("position", new THREE.BufferAttribute(new Float32Array(v), 3));
  shape.setIndex(faces);
  const made = shape.toNonIndexed();
  made.computeVertexNormals();
  return made;
}

const size = 0.055 * span * Math.min(1, (100 / agents) ** 0.25);
const darts = new THREE.InstancedMesh(dart(), new THREE.MeshLambertMaterial({ side: THREE.DoubleSide }), agents);
darts.setColorAt(0, new THREE.Color());  // makes the colours, one for each dart
const tones = darts.instanceColor.array;
darts.instanceColor.setUsage(THREE.DynamicDrawUsage);
darts.frustumCulled = false;
scene.add(darts);

// ------------------------------------------------------------------------------------------------------- trails

const MOST = 400000;  // pieces of all trails
let trail, trailSpan = 15, trailPieces = 0;

function layTrails() {
  if (trail) { scene.remove(trail); trail.geometry.dispose(); }
  trailPieces = Math.min(Math.round(trailSpan / period), Math.floor(MOST / agents), 300);
  const shape = new THREE.BufferGeometry();
  for (const name of ["position", "color"]) {
    const kept = new THREE.BufferAttribute(new Float32Array(6 * agents * trailPieces), 3);
    shape.setAttribute(name, kept.setUsage(THREE.DynamicDrawUsage));
  }
  trail = new THREE.LineSegments(shape, new THREE.LineBasicMaterial({ vertexColors: true }));
  trail.frustumCulled = false;
  scene.add(trail);
}

/** Trails up to a frame; a piece through a periodic face, or before the start, has no length. */
function drawTrails(whole, frame) {
  if (!trailPieces) return;
  const points = trail.geometry.attributes.position, colours = trail.geometry.attributes.color;
  let k = 0;
  for (let a = 0; a < agents; a++)
    for (let p = 0; p < trailPieces; p++, k += 6) {
      const end = frame - p, none = end < 1 || leaps(whole, a, end - 1), from = none ? Math.max(end, 0) : end - 1;
      let way = 0;
      for (let c = 0; c < 3; c++) {
        const x = at(whole, c, a, from), y = at(whole, c, a, Math.max(end, 0));
        points.array[k + c] = x;
        points.array[k + 3 + c] = y;
        way += (y - x) ** 2;
      }
      const pale = 0.35 + 0.6 * p / trailPieces;
      ramp(Math.sqrt(way) / period / about.top, colours.array, k, pale);
      for (let c = 0; c < 3; c++) colours.array[k + 3 + c] = colours.array[k + c];
    }
  points.needsUpdate = colours.needsUpdate = true;
}

// ----------------------------------------------------------------------------------------------------- one frame

const place = new Float32Array(3 * agents), matrix = new THREE.Matrix4(), turn = new THREE.Quaternion();
const ahead = new THREE.Vector3(1, 0, 0), way = new THREE.Vector3(), where = new THREE.Vector3();
const large = new THREE.Vector3(size, size, size);
let chosen = -1, drawnFrame = -1;

function draw(whole, time) {
  const exact = Math.min(Math.max((time - first) / period, 0), frames - 1);
  const f = Math.min(Math.floor(exact), Math.max(frames - 2, 0)), part = frames > 1 ? exact - f : 0;
  const hit = new Set(about.collisions.filter(c => time >= c[0] && time < c[0] + 1).flatMap(c => [c[1], c[2]]));
  for (let a = 0; a < agents; a++) {
    const jump = frames > 1 && leaps(whole, a, f), next = Math.min(f + 1, frames - 1);
    const b = jump && part < 0.5 ? Math.max(f - 1, 0) : f, e = jump && part < 0.5 ? f : next;
    way.set(at(whole, 0, a, e) - at(whole, 0, a, b), at(whole, 1, a, e) - at(whole, 1, a, b),
      at(whole, 2, a, e) - at(whole, 2, a, b));
    for (let c = 0; c < 3; c++) {
      const x = at(whole, c, a, f), y = at(whole, c, a, next);
      place[3 * a + c] = jump ? (part < 0.5 ? x : y) : x + part * (y - x);
    }
    const far = way.length();
    ramp(jump ? 0.5 : far / period / about.top, tones, 3 * a);
    if (a === chosen) tones.set(CHOSEN, 3 * a);
    if (hit.has(a)) tones.set(ALERT, 3 * a);
    if (far > 1e-9) turn.setFromUnitVectors(ahead, way.divideScalar(far)); else turn.identity();
    where.fromArray(place, 3 * a);
    darts.setMatrixAt(a, matrix.compose(where, turn, large));
  }
  darts.instanceMatrix.needsUpdate = darts.instanceColor.needsUpdate = true;
  const frame = Math.floor(exact + 1e-6);
  if (frame !== drawnFrame) { drawTrails(whole, frame); drawnFrame = frame; }
}

// ------------------------------------------------------------------------------------------------------- charts

const charts = about.charts.map(([title, values]) => {
  const head = document.createElement("h2"), canvas = document.createElement("canvas");
  head.textContent = title;
  $("charts").append(head, canvas);
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", title);
  canvas.addEventListener("click", e => seek(first + (e.offsetX / canvas.clientWidth) * (last - first)));
  return { canvas, values };
});

function drawChart({ canvas, values }, time) {
  const scale = Math.min(devicePixelRatio, 2), w = canvas.clientWidth, h = canvas.clientHeight;
  if (canvas.width !== w * scale) { canvas.width = w * scale; canvas.height = h * scale; }
  const pen = canvas.getContext("2d"), known = values.filter(v => v !== null);
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, w, h);
  const high = 1.08 * Math.max(...known.slice(0, 50000), 1e-9), y = v => h - 4 - (h - 10) * v / high;
  pen.strokeStyle = "#d9d9d9";
  pen.fillStyle = "#666";
  pen.font = "11px system-ui, sans-serif";
  for (const v of [0, 0.5 * high, high]) {
    pen.beginPath(); pen.moveTo(0, y(v)); pen.lineTo(w, y(v)); pen.stroke();
    pen.fillText(v.toPrecision(2), 1, Math.max(y(v) - 2, 9));
  }
  pen.strokeStyle = "#0072B2";
  pen.lineWidth = 1.6;
  pen.beginPath();
  values.forEach((v, i) => {
    if (v !== null) pen.lineTo(values.length > 1 ? i / (values.length - 1) * w : 0, y(v));
  });
  pen.stroke();
  pen.strokeStyle = "#E69F00";
  pen.beginPath();
  const x = (time - first) / Math.max(last - first, 1e-9) * w;
  pen.moveTo(x, 0); pen.lineTo(x, h); pen.stroke();
}

// ----------------------------------------------------------------------------------------------------- controls

let now = first, playing = true, speed = 1;

function seek(time) {
  now = Math.min(Math.max(time, first), last);
  drawnFrame = -1;
}

function play(on) {
  if (on && now >= last) seek(first);
  playing = on;
  $("play").textContent = on ? "Pause" : "Play";
}

function mark(time, colour, text) {
  const line = document.createElement("i"), entry = document.createElement("li"), jump = document.createElement("button");
  line.style.left = `${100 * (time - first) / Math.max(last - first, 1e-9)}%`;
  line.style.background = colour;
  $("marks").append(line);
  jump.textContent = `${time.toFixed(1)} s: ${text}`;
  jump.addEventListener("click", () => { seek(time - 1); });
  entry.append(jump);
  $("list").append(entry);
  $("happened").hidden = false;
}

/** Choose the agent under the pointer, if there is one. */
function choose(event) {
  const box = renderer.domElement.getBoundingClientRect();
  let best = 18;
  chosen = -1;
  for (let a = 0; a < agents; a++) {
    where.fromArray(place, 3 * a).project(camera);
    const x = box.left + (where.x + 1) / 2 * box.width, y = box.top + (1 - where.y) / 2 * box.height;
    const far = Math.hypot(x - event.clientX, y - event.clientY);
    if (far < best) { best = far; chosen = a; }
  }
}

function say() {
  const seed = about.seed === null ? "" : ` · seed ${about.seed}`;
  const who = chosen < 0 ? "" : ` · agent ${chosen}`;
  $("said").textContent = `${about.name} · ${agents} agents${seed}${who}`;
  $("clock").textContent = `${now.toFixed(1)} s`;
}

$("play").addEventListener("click", () => play(!playing));
$("speed").addEventListener("change", e => { speed = Number(e.target.value); });
$("trail").addEventListener("change", e => { trailSpan = Number(e.target.value); layTrails(); drawnFrame = -1; });
$("camera").addEventListener("click", () => useCamera(camera === beside ? above : beside));
$("time").min = first;
$("time").max = Math.max(last, first + 1e-6);
$("time").addEventListener("input", e => seek(Number(e.target.value)));
let pressed = null;
renderer.domElement.addEventListener("pointerdown", e => { pressed = [e.clientX, e.clientY]; });
renderer.domElement.addEventListener("pointerup", e => {
  if (pressed && Math.hypot(e.clientX - pressed[0], e.clientY - pressed[1]) < 4) choose(e);
});
addEventListener("keydown", e => {
  if (e.target.closest("button, select, input") && e.key !== "p") return;
  if (e.key === " " || e.key === "p") { play(!playing); e.preventDefault(); }
  if (e.key === "ArrowRight") seek(now + period);
  if (e.key === "ArrowLeft") seek(now - period);
});
addEventListener("resize", fit);

async function main() {
  const whole = await unpack();
  const happened = [
    ...about.collisions.map(([t, i, j]) => [t, "#D50032", `collision of ${i} and ${j}`]),
    ...about.events.map(([t, what]) => [t, "#0072B2", what]),
  ];
  happened.sort((a, b) => a[0] - b[0]).forEach(entry => mark(...entry));
  $("bar").style.background = `linear-gradient(to right, ${about.ramp.map(c => `rgb(${c})`)})`;
  $("top").textContent = `${about.top} m/s`;
  layTrails();
  useCamera(camera);
  let then = performance.now(), charted = -1e9;
  const busy = [];
  const tick = stamp => {
    const began = performance.now();
    if (playing) now = Math.min(now + speed * Math.min((stamp - then) / 1000, 0.2), last);
    if (playing && now >= last) play(false);
    then = stamp;
    draw(whole, now);
    if (stamp - charted > 200) { charts.forEach(chart => drawChart(chart, now)); charted = stamp; }
    if (document.activeElement !== $("time")) $("time").value = now;
    say();
    controls.update();
    busy.push(performance.now() - began);
    if (busy.length > 120) busy.shift();
    renderer.render(scene, camera);
    requestAnimationFrame(tick);
  };
  window.replay = {  // for tests
    position: (agent, frame) => Array.from({ length: axes }, (_, axis) => at(whole, axis, agent, frame)),
    get time() { return now; }, get playing() { return playing; }, get busy() { return busy; }, seek, play,
  };
  requestAnimationFrame(tick);
}

main().catch(fault => { $("said").textContent = `This replay cannot be played: ${fault.message}`; });
