"use strict";
// Plays one recording on the scene: draws a frame at a time, and listens to the controls.

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

// ----------------------------------------------------------------------------------------------------- controls

let now = first, speed = 1;
let playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;  // else it waits for Play

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
  $("said").textContent = `${about.name} · ${agents} agent${agents === 1 ? "" : "s"}${seed}${who}`;
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
  play(playing);
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
