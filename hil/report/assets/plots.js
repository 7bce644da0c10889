"use strict";
// Draws the report's plots as SVG on one linked time axis. Drag to zoom, double-click to go back, move to read values.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const arrays = data.arrays.map((text) => {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    return new Float32Array(bytes.buffer);
  });
  const LEFT = 46, RIGHT = 10, TOP = 20, BOTTOM = 18, STRIP = 5;
  const SPIKE = 0.004;  // share of the samples that a spike may be
  const PHASES = ["#e8e3d8", "#cfd9e6", "#dcd3e6", "#cfe3d8", "#efe0c4", "#f0d3cf", "#d9dde2"];
  const home = [Math.min(...data.flights.map((f) => f.home[0])), Math.max(...data.flights.map((f) => f.home[1]))];
  const full = [Math.min(...data.flights.map((f) => f.full[0])), Math.max(...data.flights.map((f) => f.full[1]))];
  const decided = data.flights.map((f) => f.decided).filter((t) => t !== null);
  let view = home.slice(), cursor = null, waiting = false;
  const plots = [], phases = [...new Set(data.flights.flatMap((f) => f.phases.map((p) => p[2])))];
  const two = data.flights.length > 1;
  let printing = false;

  const make = (tag, attributes, parent, text) => {
    const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const key in attributes) element.setAttribute(key, attributes[key]);
    if (text !== undefined) element.textContent = text;
    if (parent) parent.appendChild(element);
    return element;
  };
  const node = (tag, css, parent, text) => {
    const element = document.createElement(tag);
    if (css) element.className = css;
    if (text !== undefined) element.textContent = text;
    parent.appendChild(element);
    return element;
  };
  const ticks = (low, high, about) => {
    const raw = (high - low) / about, power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw * 0.999);
    const out = [];
    for (let i = Math.ceil(low / step - 1e-9); i <= Math.floor(high / step + 1e-9); i++) out.push(i * step);
    return { values: out, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
  };
  // first index with t[i] >= value
  const lower = (t, value) => {
    let a = 0, b = t.length;
    while (a < b) { const m = (a + b) >> 1; if (t[m] < value) a = m + 1; else b = m; }
    return a;
  };
  const text = (value) => Math.abs(value) >= 100 ? value.toFixed(0) : Math.abs(value) >= 10 ? value.toFixed(1) : value.toFixed(2);

  // what is visible, smallest and largest a pixel column if there is more than can be seen
  function points(t, y, scale, step) {
    const from = Math.max(0, lower(t, view[0]) - 1), to = Math.min(t.length, lower(t, view[1]) + 1);
    const parts = []; let pen = "M", lastT = NaN, lastV = 0;
    const put = (i) => {
      if (!Number.isFinite(y[i])) { pen = "M"; return; }
      if (pen === "L" && t[i] - lastT > 0.5) pen = "M";
      const u = scale.x(t[i]).toFixed(1), v = scale.y(y[i]).toFixed(1);
      if (step && pen === "L") parts.push("L" + u + " " + lastV);
      parts.push(pen + u + " " + v);
      pen = "L"; lastT = t[i]; lastV = v;
    };
    if (to - from <= 3 * scale.width) { for (let i = from; i < to; i++) put(i); return parts.join(""); }
    let i = from;
    while (i < to) {
      const column = Math.floor(scale.x(t[i]));
      let low = i, high = i, last = i, holes = false;
      while (last < to && Math.floor(scale.x(t[last])) === column) {
        if (!Number.isFinite(y[last])) holes = true;
        if (!(y[low] <= y[last])) low = Number.isFinite(y[last]) ? last : low;
        if (!(y[high] >= y[last])) high = Number.isFinite(y[last]) ? last : high;
        last++;
      }
      for (const k of [...new Set([i, low, high, last - 1])].sort((a, b) => a - b)) put(k);
      if (holes) pen = "M";
      i = last;
    }
    return parts.join("");
  }

  // The y axis: what is visible, but for a spike of a few samples that would flatten all the rest (it gets a mark).
  function range(spec) {
    if (spec.fixed) return spec.fixed;
    const seen = [];
    for (const s of spec.series) {
      const t = arrays[s.t], y = arrays[s.y];
      for (let i = lower(t, view[0]), n = lower(t, view[1]); i < n; i++) if (Number.isFinite(y[i])) seen.push(y[i]);
    }
    if (!seen.length) return [0, 1];
    const sorted = Float32Array.from(seen).sort(), last = sorted.length - 1;
    const few = Math.floor(SPIKE * last), usual = [sorted[few], sorted[last - few]], span = usual[1] - usual[0];
    let [low, high] = [sorted[0], sorted[last]];
    if (span > 0 && high - usual[1] > 2 * span) high = usual[1] + 0.25 * span;
    if (span > 0 && usual[0] - low > 2 * span) low = usual[0] - 0.25 * span;
    let room = high - low;  // a limit is shown when it is near what was flown
    for (const [value] of spec.lines) {
      if (value > high && value < high + 0.6 * room) high = value;
      if (value < low && value > low - 0.6 * room) low = value;
    }
    room = Math.max(0.07 * (high - low), 1e-3);
    return [low - room, high + room];
  }

  class Plot {
    constructor(spec) {
      this.spec = spec;
      this.flights = [...new Set(spec.series.map((s) => s.flight))].sort();
      this.root = document.getElementById(spec.id);
      const head = node("figcaption", "", this.root);
      node("b", "", head, spec.title);
      node("span", "unit", head, " " + spec.unit);
      this.legend = node("span", "legend", head);
      this.values = spec.series.map((s) => {
        if (!s.name) return null;
        const item = node("span", "key " + s.style + (s.flight ? " second" : ""), this.legend);
        node("i", "", item).style.setProperty("--c", s.colour);
        node("span", "", item, (two ? "AB"[s.flight] + ": " : "") + s.name);
        return node("output", "", item);
      });
      this.svg = make("svg", { role: "img", "aria-label": spec.title + ", " + spec.unit, tabindex: "-1" }, this.root);
      this.svg.addEventListener("pointerdown", (e) => this.press(e));
      this.svg.addEventListener("pointermove", (e) => { setCursor(this.time(e)); });
      this.svg.addEventListener("pointerleave", () => setCursor(null));
      this.svg.addEventListener("dblclick", () => setView(home));
      this.svg.addEventListener("wheel", (e) => {
        if (!e.ctrlKey && !e.shiftKey) return;
        e.preventDefault();
        const t = this.time(e), k = (e.deltaY || e.deltaX) > 0 ? 1.25 : 0.8;
        setView([t + (view[0] - t) * k, t + (view[1] - t) * k]);
      }, { passive: false });
    }

    time(event) {
      const box = this.svg.getBoundingClientRect();
      const x = (event.clientX - box.left) / box.width * this.width;
      return view[0] + Math.min(1, Math.max(0, (x - LEFT) / (this.width - LEFT - RIGHT))) * (view[1] - view[0]);
    }

    press(event) {
      if (event.button) return;
      const start = this.time(event), from = event.clientX;
      this.svg.setPointerCapture(event.pointerId);
      const move = (e) => {
        const now = this.time(e);
        this.drag = [Math.min(start, now), Math.max(start, now)];
        this.shade();
      };
      const up = (e) => {
        this.svg.removeEventListener("pointermove", move);
        this.svg.removeEventListener("pointerup", up);
        this.svg.removeEventListener("pointercancel", up);
        const drag = this.drag;
        this.drag = null;
        this.shade();
        if (e.type === "pointerup" && drag && Math.abs(e.clientX - from) > 6) setView(drag);
      };
      this.svg.addEventListener("pointermove", move);
      this.svg.addEventListener("pointerup", up);
      this.svg.addEventListener("pointercancel", up);
    }

    shade() {
      if (!this.band) return;
      const [a, b] = this.drag || [view[0], view[0]];
      this.band.setAttribute("x", this.scale.x(a));
      this.band.setAttribute("width", Math.max(0, this.scale.x(b) - this.scale.x(a)));
    }

    draw(low, high) {
      const width = this.width = printing ? 700 : Math.max(240, Math.round(this.root.clientWidth)), height = this.spec.height + TOP + BOTTOM;
      const bottom = height - BOTTOM, right = width - RIGHT, svg = this.svg;
      const scale = this.scale = {
        width: right - LEFT,
        x: (t) => LEFT + (t - view[0]) / (view[1] - view[0]) * (right - LEFT),
        y: (v) => this.spec.down ? TOP + (v - low) / (high - low) * (bottom - TOP)
          : bottom - (v - low) / (high - low) * (bottom - TOP),
      };
      svg.replaceChildren();
      svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
      const clip = this.spec.id + "-clip";
      make("rect", { x: LEFT, y: TOP, width: right - LEFT, height: bottom - TOP },
        make("clipPath", { id: clip }, make("defs", {}, svg)));
      const ys = ticks(low, high, Math.max(3, Math.round(this.spec.height / 22)));
      for (const value of ys.values) {
        make("path", { class: "grid", d: `M${LEFT} ${scale.y(value).toFixed(1)}H${right}` }, svg);
        make("text", { class: "tick", x: LEFT - 5, y: scale.y(value) + 3.5, "text-anchor": "end" }, svg, value.toFixed(ys.digits));
      }
      const xs = ticks(view[0], view[1], Math.max(3, Math.round(width / 90)));
      for (const value of xs.values) {
        make("path", { class: "grid", d: `M${scale.x(value).toFixed(1)} ${TOP}V${bottom}` }, svg);
        if (scale.x(value) > right - 24) continue;  // the unit stands there
        make("text", { class: "tick", x: scale.x(value), y: bottom + 13, "text-anchor": "middle" }, svg, value.toFixed(xs.digits));
      }
      make("text", { class: "tick unit", x: right, y: bottom + 13, "text-anchor": "end" }, svg, "s");
      this.phases(svg, scale, right);
      const inside = make("g", { "clip-path": `url(#${clip})` }, svg);
      for (const [value, name] of this.spec.lines) {
        if (value < low || value > high) continue;
        make("path", { class: "limit", d: `M${LEFT} ${scale.y(value).toFixed(1)}H${right}` }, inside);
        make("text", { class: "limit", x: LEFT + 4, y: scale.y(value) + (scale.y(value) < TOP + 14 ? 11 : -3) }, inside, name);
      }
      const back = [...this.spec.series].sort((a, b) => b.flight - a.flight);  // the first flight lies over the second
      for (const s of back) this.series(inside, scale, s);
      this.marks(svg, inside, scale, bottom);
      this.beyond(svg, scale, low, high);
      this.band = make("rect", { class: "band", x: 0, y: TOP, width: 0, height: bottom - TOP }, svg);
      this.line = make("path", { class: "cursor", d: "" }, svg);
    }

    series(parent, scale, s) {
      const t = arrays[s.t], y = arrays[s.y], other = s.flight ? " second" : "";
      if (s.style === "dots") {
        const parts = [];
        for (let i = lower(t, view[0]), n = lower(t, view[1]); i < n; i++) {
          if (Number.isFinite(y[i])) parts.push(`M${scale.x(t[i]).toFixed(1)} ${scale.y(y[i]).toFixed(1)}h0`);
        }
        make("path", { class: "dots" + other, d: parts.join(""), stroke: s.colour }, parent);
      } else {
        make("path", { class: s.style + other, d: points(t, y, scale, s.style === "step"), stroke: s.colour }, parent);
      }
    }

    // A triangle where values leave the axis, with the farthest of them.
    beyond(svg, scale, low, high) {
      for (const upper of [true, false]) {
        let most = null, when = 0;
        for (const s of this.spec.series) {
          const t = arrays[s.t], y = arrays[s.y];
          for (let i = lower(t, view[0]), n = lower(t, view[1]); i < n; i++) {
            if (!Number.isFinite(y[i]) || (upper ? y[i] <= high : y[i] >= low)) continue;
            if (most === null || (upper ? y[i] > most : y[i] < most)) { most = y[i]; when = t[i]; }
          }
        }
        if (most === null) continue;
        const x = scale.x(when), y = scale.y(upper ? high : low), way = (upper !== !!this.spec.down) ? 1 : -1;
        make("path", { class: "beyond", d: `M${x.toFixed(1)} ${(y + 1 * way).toFixed(1)}l4 ${6 * way}h-8z` }, svg);
        const anchor = x > this.width - 70 ? "end" : "start";
        make("text", { class: "beyond", x: x + (anchor === "end" ? -6 : 6), y: y + (way > 0 ? 9 : -3), "text-anchor": anchor },
          svg, text(most));
      }
    }

    phases(svg, scale, right) {
      this.flights.forEach((flight, k) => {
        for (const [a, b, name] of data.flights[flight].phases) {
          const x = Math.max(LEFT, scale.x(a)), end = Math.min(right, scale.x(b)), y = TOP - STRIP * (this.flights.length - k);
          if (end <= x) continue;
          const bar = make("rect", { x, y, width: end - x, height: STRIP, fill: PHASES[phases.indexOf(name) % PHASES.length] }, svg);
          make("title", {}, bar, (two ? "AB"[flight] + ": " : "") + name);
          if (!k && end - x > 6 * name.length) make("text", { class: "phase", x: x + 2, y: y - 2 }, svg, name);
        }
      });
    }

    marks(svg, parent, scale, bottom) {
      this.flights.forEach((flight, k) => {
        for (const [t, severity, words, label] of data.flights[flight].marks) {
          if (t < view[0] || t > view[1] || (two && !label)) continue;
          const x = scale.x(t).toFixed(1), name = (two ? "AB"[flight] + " " : "") + label;
          const line = make("path", { class: "mark " + severity, d: `M${x} ${TOP}V${bottom}` }, parent);
          make("title", {}, line, `${t.toFixed(3)} s  ${words}`);
          if (label) make("text", { class: "mark " + severity, x: x - 3, y: TOP + 10 + 11 * k, "text-anchor": "end" }, parent, name);
        }
      });
    }

    read() {
      if (!this.line) return;
      const t = cursor;
      this.line.setAttribute("d", t === null ? "" : `M${this.scale.x(t).toFixed(1)} ${TOP}V${this.spec.height + TOP}`);
      this.spec.series.forEach((s, i) => {
        if (!this.values[i]) return;
        let value = "";
        if (t !== null) {
          const times = arrays[s.t], k = lower(times, t);
          const j = k > 0 && (k === times.length || t - times[k - 1] < times[k] - t) ? k - 1 : k;
          if (j < times.length && Math.abs(times[j] - t) < 0.1 && Number.isFinite(arrays[s.y][j])) value = text(arrays[s.y][j]);
        }
        this.values[i].textContent = value;
      });
    }
  }

  function redraw() {
    for (const plot of plots) { plot.draw(...range(plot.spec)); plot.read(); }
    const words = document.getElementById("shown");
    if (words) words.textContent = `${view[0].toFixed(2)} to ${view[1].toFixed(2)} s`;
    document.documentElement.dataset.view = view.map((v) => v.toFixed(4)).join(" ");
  }
  function setView([a, b]) {
    a = Math.max(full[0] - 0.5, a); b = Math.min(full[1] + 0.5, b);
    if (b - a < 0.01) return;
    view = [a, b];
    soon();
  }
  function soon() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; redraw(); });
  }
  function setCursor(t) {
    cursor = t;
    const now = document.getElementById("now");
    if (now) now.textContent = t === null ? "" : `${t.toFixed(3)} s`;
    for (const plot of plots) plot.read();
  }

  for (const spec of data.plots) plots.push(new Plot(spec));
  const views = { attempt: home, all: full, last: decided.length ? [Math.max(...decided) - 1, Math.max(...decided) + 0.1] : home };
  for (const button of document.querySelectorAll("[data-show]")) {
    button.addEventListener("click", () => setView(views[button.dataset.show]));
  }
  document.getElementById("out")?.addEventListener("click", () => {
    const middle = (view[0] + view[1]) / 2, half = view[1] - view[0];
    setView([middle - half, middle + half]);
  });
  redraw();
  document.documentElement.dataset.ready = "yes";
  let width = document.documentElement.clientWidth;
  addEventListener("resize", () => {
    if (document.documentElement.clientWidth !== width) { width = document.documentElement.clientWidth; soon(); }
  });
  addEventListener("beforeprint", () => { printing = true; cursor = null; redraw(); });
  addEventListener("afterprint", () => { printing = false; redraw(); });
})();
