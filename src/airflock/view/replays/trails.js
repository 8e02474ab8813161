"use strict";
// Trails, computed here from the positions: of each frame only what is new is written.

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
