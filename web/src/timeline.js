// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The timeline: K over the whole history, collisions and contacts, window and moment; dragging moves the moment.

import { faded } from "./colours.js";
import { el, resized } from "./dom.js";
import { envelope } from "./sampling.js";
import { field } from "./quantities.js";

export class Timeline {
  constructor(shared) {
    this.shared = shared;
    this.canvas = el("canvas");
    this.handle = el("div", { class: "handle" });
    this.frame = el("div", { class: "window" });
    this.node = el("div", { class: "timeline", role: "slider", "aria-label": "time", tabindex: "0" }, this.canvas, this.frame, this.handle);
    this.node.addEventListener("pointerdown", (event) => this.#grab(event));
    this.node.addEventListener("pointermove", (event) => this.held && this.#go(event));
    for (const end of ["pointerup", "pointercancel"]) this.node.addEventListener(end, () => (this.held = false));
    resized(this.node, () => this.draw());
  }

  #grab(event) {
    this.held = true;
    this.node.setPointerCapture(event.pointerId);
    this.#go(event);
  }

  #go(event) {
    const rows = this.shared.rows();
    const rect = this.node.getBoundingClientRect();
    const part = Math.min(1, Math.max(0, (event.clientX - rect.left) / rect.width));
    if (rows.length) this.shared.view.go(rows.first + part * (rows.last - rows.first));
  }

  draw() {
    const rows = this.shared.rows();
    const layout = this.shared.layout();
    const [width, height] = [this.node.clientWidth, this.node.clientHeight];
    if (!width || !rows?.length) return;
    const scale = devicePixelRatio;
    if (this.canvas.width !== Math.round(width * scale)) this.canvas.width = Math.round(width * scale);
    if (this.canvas.height !== Math.round(height * scale)) this.canvas.height = Math.round(height * scale);
    const ctx = this.canvas.getContext("2d");
    ctx.setTransform(scale, 0, 0, scale, 0, 0);
    ctx.clearRect(0, 0, width, height);
    const [x, energy] = envelope(rows, 0, rows.length, Math.min(600, Math.floor(width / 2)), [field(layout, "K")]);
    const [first, last] = [rows.first, Math.max(rows.last, rows.first + 1e-9)];
    const across = (t) => (width * (t - first)) / (last - first);
    const most = energy.reduce((a, b) => Math.max(a, b ?? 0), 1e-12);
    const { colours } = this.shared.theme;
    ctx.fillStyle = faded("#4e79a7", 0.55);
    let from = 0;
    for (let k = 0; k <= x.length; k++) {
      if (k < x.length && energy[k] !== null) continue;
      ctx.beginPath(); // between two gaps
      for (let n = from; n < k; n++) ctx.lineTo(across(x[n]), height - ((height - 5) * energy[n]) / most);
      if (k > from) {
        ctx.lineTo(across(x[k - 1]), height);
        ctx.lineTo(across(x[from]), height);
      }
      ctx.fill();
      from = k + 1;
    }
    for (const { start, end, kind } of this.shared.events()) {
      ctx.fillStyle = kind === "collision" ? colours.bad : colours.warn;
      ctx.fillRect(across(start) - 1, 0, Math.max(2, across(end) - across(start)), 5);
    }
    this.place();
  }

  place() {
    const rows = this.shared.rows();
    if (!rows?.length) return;
    const width = this.node.clientWidth;
    const across = (t) => Math.min(width, Math.max(0, (width * (t - rows.first)) / Math.max(1e-9, rows.last - rows.first)));
    const [t0, t1] = this.shared.view.window();
    this.frame.style.left = `${across(t0)}px`;
    this.frame.style.width = `${Math.max(2, across(t1) - across(t0))}px`;
    this.handle.style.transform = `translateX(${across(this.shared.view.now())}px)`;
    this.node.setAttribute("aria-valuetext", this.shared.view.label(this.shared.view.now()));
  }
}
