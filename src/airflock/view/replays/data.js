"use strict";
// What a replay holds: #about (JSON) and #data (deflated positions and bytes, base64).

const about = JSON.parse(document.getElementById("about").textContent);
const [frames, axes, agents] = about.shape;
const { stage, period, first } = about;
const last = first + (frames - 1) * period;
const $ = id => document.getElementById(id);

// ---------------------------------------------------------------------------------------------------- positions

let rows = [];  // bytes of the layers, agent by agent, frame by frame; at last, unless all are there, who is

/** Inflate the data and add the differences up: one Uint16Array, axis by axis, agent by agent, frame by frame. */
async function unpack() {
  const bytes = Uint8Array.from(atob($("data").textContent), c => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const halves = new Uint8Array(await new Response(stream).arrayBuffer());
  const count = frames * axes * agents, whole = new Uint16Array(count);
  for (let row = 0; row < count; row += frames)
    for (let f = 0, sum = 0; f < frames; f++)
      whole[row + f] = sum = (sum + halves[row + f] + (halves[count + row + f] << 8)) & 0xffff;
  for (let from = 2 * count; from < halves.length; from += frames * agents) {
    const bytes = halves.subarray(from, from + frames * agents);
    for (let row = 0; row < bytes.length; row += frames)
      for (let f = 1; f < frames; f++) bytes[row + f] += bytes[row + f - 1];  // modulo 2^8
    rows.push(bytes);
  }
  return whole;
}

/** Whether an agent is there at a frame. */
const there = (agent, frame) => about.whole || rows[about.layers.length][agent * frames + frame] === 1;

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
