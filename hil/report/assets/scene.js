"use strict";
// The attempt in 3-D: orthographic lines, turned by dragging.
for (const root of document.querySelectorAll(".scene")) {
  const scene = JSON.parse(root.dataset.scene);
  const W = 640, H = 340, NS = "http://www.w3.org/2000/svg";
  const centre = scene.low.map((v, i) => (v + scene.high[i]) / 2);
  let azimuth = scene.azimuth, elevation = 0.45;
  const grid = [], [x0, y0] = scene.low.map((v) => Math.floor(v)), [x1, y1] = scene.high.map((v) => Math.ceil(v));
  for (let x = x0; x <= x1; x++) grid.push([[x, y0, 0], [x, y1, 0]]);
  for (let y = y0; y <= y1; y++) grid.push([[x0, y, 0], [x1, y, 0]]);
  const all = [...grid.map((p) => ({ p, c: "#e6e8eb", w: 1 })), ...scene.lines];
  const svg = root.appendChild(document.createElementNS(NS, "svg"));
  svg.setAttribute("viewBox", `0 0 ${W} ${H}`);
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", "The attempt in 3-D");
  const paths = all.map((line) => {
    const path = svg.appendChild(document.createElementNS(NS, "path"));
    path.setAttribute("style", `fill:none;stroke:${line.c};stroke-width:${line.w};stroke-linejoin:round`);
    return path;
  });
  const draw = () => {
    const [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
    const seen = all.map((line) => line.p.map(([x, y, z]) => {
      const dx = x - centre[0], dy = y - centre[1], dz = z - centre[2];
      return [sa * dx - ca * dy, se * (ca * dx + sa * dy) + ce * dz];
    }));
    const us = seen.flat().map((p) => p[0]), vs = seen.flat().map((p) => p[1]);
    const [left, right, low, high] = [Math.min(...us), Math.max(...us), Math.min(...vs), Math.max(...vs)];
    const scale = Math.min((W - 16) / (right - left), (H - 16) / (high - low));
    const put = ([u, v]) => (W / 2 + scale * (u - (left + right) / 2)).toFixed(1) + " " +
      (H / 2 - scale * (v - (low + high) / 2)).toFixed(1);
    seen.forEach((points, i) => paths[i].setAttribute("d", "M" + points.map(put).join("L")));
  };
  svg.addEventListener("pointerdown", (start) => {
    if (start.button) return;
    svg.setPointerCapture(start.pointerId);
    let last = start;
    const move = (e) => {
      azimuth -= (e.clientX - last.clientX) * 0.01;
      elevation = Math.min(1.57, Math.max(0, elevation + (e.clientY - last.clientY) * 0.01));
      last = e;
      draw();
    };
    const up = () => {
      svg.removeEventListener("pointermove", move);
      svg.removeEventListener("pointerup", up);
      svg.removeEventListener("pointercancel", up);
    };
    svg.addEventListener("pointermove", move);
    svg.addEventListener("pointerup", up);
    svg.addEventListener("pointercancel", up);
  });
  draw();
}
