"use strict";
// Charts beside the scene; a click on one goes to its time.

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
    const x = values.length > 1 ? i / (values.length - 1) * w : 0;
    if (v !== null) values[i - 1] == null ? pen.moveTo(x, y(v)) : pen.lineTo(x, y(v));  // no line over a gap
  });
  pen.stroke();
  pen.strokeStyle = "#E69F00";
  pen.beginPath();
  const x = (time - first) / Math.max(last - first, 1e-9) * w;
  pen.moveTo(x, 0); pen.lineTo(x, h); pen.stroke();
}
