"use strict";
// What the colours of agents stand for: their motion, or a layer of bytes; and the key that says so.

/** A colour between two of a table, written into `out` from `place` on as light, each part from 0 to 1. */
function between(table, x, out, place) {
  const i = Math.min(Math.floor(x), table.length - 1), part = x - i, next = table[(i + 1) % table.length];
  for (let c = 0; c < 3; c++) {
    const tone = (table[i][c] * (1 - part) + next[c] * part) / 255;
    out[place + c] = linear(tone);
  }
}

/** Colour of a share from 0 to 1 of a scale, or of a full turn. */
const ramp = (share, out, place) =>
  between(about.ramp, Math.min(Math.max(share, 0), 1) * (about.ramp.length - 1), out, place);
const wheel = (share, out, place) =>
  between(about.wheel, (share - Math.floor(share)) * about.wheel.length, out, place);

let way = about.way, layer = null, bytes = null;

/** Colour of an agent at a frame, which flies (dx, dy, dz) until the next one. */
function tone(whole, agent, frame, dx, dy, dz, out, place) {
  if (layer) {
    const value = bytes[agent * frames + frame];
    if (value === 255) between([about.blank], 0, out, place);
    else if (layer.kind === "scale") ramp(value / 254, out, place);
    else if (layer.kind === "names") between(layer.tones, value, out, place);
    else wheel(value / 255, out, place);
  } else if (way === "heading") wheel(Math.atan2(dy, dx) / (2 * Math.PI), out, place);
  else if (way === "agent") wheel(agent * 0.6180339887, out, place);
  else if (way === "height") {
    const [low, high] = about.height;
    ramp((at(whole, 2, agent, frame) - low) / Math.max(high - low, 1e-9), out, place);
  } else ramp(Math.hypot(dx, dy, dz) / period / about.top, out, place);
}

/** Say what the colours stand for. */
function tell() {
  const place = about.layers.findIndex(each => each.name === way);
  [layer, bytes] = place < 0 ? [null, null] : [about.layers[place], rows[place]];
  const kind = layer ? layer.kind : way === "heading" ? "turn" : way === "agent" ? "marks" : "scale";
  const motion = { speed: ["0", `${about.top} m/s`], heading: ["east", "north, west, south, east"],
    height: about.height.map((h, i) => h.toPrecision(3) + (i ? " m" : "")) };
  const ends = layer ? layer.ends : motion[way];
  const css = c => `rgb(${c})`, table = kind === "turn" ? [...about.wheel, about.wheel[0]] : about.ramp;
  const scaled = kind === "scale" || kind === "turn";
  $("bar").style.background = scaled ? `linear-gradient(to right, ${table.map(css)})` : "none";
  $("ends").replaceChildren(...(scaled ? [ends[0], way, ends[1]] : [way]).map(text => {
    const span = document.createElement("span");
    span.textContent = text;
    return span;
  }));
  $("names").replaceChildren();
  const chips = kind === "names" ? layer.names.map((name, i) => [name, layer.tones[i]]) : [];
  if (kind === "names") chips.push([layer.told || "none", about.blank]);
  for (const [name, colour] of chips) {
    const entry = document.createElement("span"), dot = document.createElement("i");
    dot.style.background = css(colour);
    entry.append(dot, name);
    $("names").append(entry);
  }
  if (kind === "marks") $("names").textContent = layer ? layer.told : "each agent has a colour of its own";
}

/** sRGB decoded to light, which three.js computes with. */
const linear = c => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
const CHOSEN = [1.0, 0.26, 0.0], ALERT = [0.67, 0.0, 0.03];
