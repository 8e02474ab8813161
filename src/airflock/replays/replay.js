"use strict";
// Plays one recording, which `data.js` unpacked and `colours.js` colours.

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
const step = [0, 0, 0], newest = { value: 0 };
let trail, trailSpan = 15, trailPieces = 0, trailFrame = -1;

/** Lines whose colours pale with age: each piece lies in a slot of its own, which the next one of that slot takes. */
function layTrails() {
  if (trail) { scene.remove(trail); trail.geometry.dispose(); trail.material.dispose(); }
  trailPieces = Math.min(Math.round(trailSpan / period), Math.floor(MOST / agents), 300);
  const shape = new THREE.BufferGeometry(), slots = new Float32Array(2 * agents * trailPieces);
  for (const name of ["position", "color"]) {
    const kept = new THREE.BufferAttribute(new Float32Array(6 * agents * trailPieces), 3);
    shape.setAttribute(name, kept.setUsage(THREE.DynamicDrawUsage));
  }
  for (let k = 0; k < slots.length; k++) slots[k] = Math.floor(k / (2 * agents));
  shape.setAttribute("slot", new THREE.BufferAttribute(slots, 1));
  const material = new THREE.LineBasicMaterial({ vertexColors: true });
  material.onBeforeCompile = shader => {
    shader.uniforms.newest = newest;
    shader.uniforms.slots = { value: Math.max(trailPieces, 1) };
    shader.vertexShader = "attribute float slot; uniform float newest; uniform float slots;\n"
      + shader.vertexShader.replace("#include <color_vertex>", `#include <color_vertex>
        float pale = 0.35 + 0.6 * mod(newest - slot + slots, slots) / slots;
        vColor.rgb = pow(mix(pow(vColor.rgb, vec3(1.0 / 2.2)), vec3(0.92), pale), vec3(2.2));`);
  };
  trail = new THREE.LineSegments(shape, material);
  trail.frustumCulled = false;
  scene.add(trail);
  trailFrame = -1;
}

/** The piece of every trail that ends at a frame; through a periodic face, before the start or absent it is a point. */
function drawPiece(whole, end, points, colours) {
  const slot = ((end % trailPieces) + trailPieces) % trailPieces, last = Math.max(end, 0);
  let k = 6 * agents * slot;
  for (let a = 0; a < agents; a++, k += 6) {
    const none = end < 1 || leaps(whole, a, end - 1) || !there(a, end) || !there(a, end - 1);
    const from = none ? last : end - 1;
    for (let c = 0; c < 3; c++) {
      const x = at(whole, c, a, from), y = at(whole, c, a, last);
      points.array[k + c] = x;
      points.array[k + 3 + c] = y;
      step[c] = y - x;
    }
    tone(whole, a, last, step[0], step[1], step[2], colours.array, k);
    for (let c = 0; c < 3; c++) colours.array[k + 3 + c] = colours.array[k + c];
  }
  return 6 * agents * slot;
}

/** Trails up to a frame: only the pieces that are new since the last call, or all of them after a leap in time. */
function drawTrails(whole, frame, anew) {
  if (!trailPieces) return;
  const { position, color } = trail.geometry.attributes, size = 6 * agents;
  const some = !anew && trailFrame >= 0 && frame >= trailFrame && frame - trailFrame < trailPieces;
  for (let end = some ? trailFrame + 1 : frame - trailPieces + 1; end <= frame; end++) {
    const begin = drawPiece(whole, end, position, color);
    if (some) for (const kept of [position, color]) kept.addUpdateRange(begin, size);
  }
  if (!some) for (const kept of [position, color]) kept.clearUpdateRanges();
  position.needsUpdate = color.needsUpdate = true;
  newest.value = ((frame % trailPieces) + trailPieces) % trailPieces;
  trailFrame = frame;
}

// ----------------------------------------------------------------------------------------------------- one frame

const place = new Float32Array(3 * agents), matrix = new THREE.Matrix4(), turn = new THREE.Quaternion();
const ahead = new THREE.Vector3(1, 0, 0), flown = new THREE.Vector3(), where = new THREE.Vector3();
const large = new THREE.Vector3(size, size, size), gone = new THREE.Vector3(0, 0, 0);
let chosen = -1, drawnFrame = -1, shownFrame = 0;

function draw(whole, time) {
  const exact = Math.min(Math.max((time - first) / period, 0), frames - 1);
  const f = Math.min(Math.floor(exact), Math.max(frames - 2, 0)), part = frames > 1 ? exact - f : 0;
  shownFrame = f;
  const hit = new Set(about.collisions.filter(c => time >= c[0] && time < c[0] + 1).flatMap(c => [c[1], c[2]]));
  for (let a = 0; a < agents; a++) {
    const jump = frames > 1 && leaps(whole, a, f), next = Math.min(f + 1, frames - 1);
    const b = jump && part < 0.5 ? Math.max(f - 1, 0) : f, e = jump && part < 0.5 ? f : next;
    flown.set(at(whole, 0, a, e) - at(whole, 0, a, b), at(whole, 1, a, e) - at(whole, 1, a, b),
      at(whole, 2, a, e) - at(whole, 2, a, b));
    for (let c = 0; c < 3; c++) {
      const x = at(whole, c, a, f), y = at(whole, c, a, next);
      place[3 * a + c] = jump ? (part < 0.5 ? x : y) : x + part * (y - x);
    }
    const far = flown.length();
    tone(whole, a, f, flown.x, flown.y, flown.z, tones, 3 * a);
    if (a === chosen) tones.set(CHOSEN, 3 * a);
    if (hit.has(a)) tones.set(ALERT, 3 * a);
    if (far > 1e-9) turn.setFromUnitVectors(ahead, flown.divideScalar(far)); else turn.identity();
    where.fromArray(place, 3 * a);
    darts.setMatrixAt(a, matrix.compose(where, turn, there(a, f) ? large : gone));
  }
  darts.instanceMatrix.needsUpdate = darts.instanceColor.needsUpdate = true;
  const frame = Math.floor(exact + 1e-6);
  if (frame !== drawnFrame) { drawTrails(whole, frame, drawnFrame < 0); drawnFrame = frame; }
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
    if (!there(a, shownFrame)) continue;
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
  for (const name of about.ways) $("way").append(new Option(name, name, false, name === way));
  $("way").addEventListener("change", e => { way = e.target.value; tell(); drawnFrame = -1; });
  tell();
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
    colour: agent => Array.from(tones.slice(3 * agent, 3 * agent + 3)),
    get time() { return now; }, get playing() { return playing; }, get busy() { return busy; }, seek, play,
  };
  requestAnimationFrame(tick);
}

main().catch(fault => { $("said").textContent = `This replay cannot be played: ${fault.message}`; });
