"use strict";
// The scene of a replay: lights, two cameras, what stands, and a dart for each agent.

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
