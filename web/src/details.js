// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// All quantities of the selected joint or link.

import { el, say } from "./dom.js";
import { measure, metres, number, percent } from "./format.js";
import { exchange, field, K, noiseOf, ofLimit, share } from "./quantities.js";

export class Details {
  constructor(layout, { close }) {
    this.layout = layout;
    this.title = el("h2");
    this.list = el("dl");
    this.node = el("aside", { class: "details", hidden: true }, el("header", {}, this.title, el("button", { class: "plain", title: "close (Esc)", "aria-label": "close", text: "×", onclick: close })), this.list);
  }

  show(link, dof) {
    this.node.hidden = link === null;
    if (link === null) return;
    const { layout } = this;
    const lines = [];
    const noise = noiseOf(layout);
    const add = (label, get, unit, shown = (x) => measure(x, noise[unit])) => lines.push({ label, get, unit, shown, cell: el("b") });
    const f = (name, k) => field(layout, name, k);
    const slides = layout.json.angular?.[dof] === false;
    const [turn, moment] = slides ? ["m", "N"] : ["rad", "N m"];
    if (dof >= 0) {
      const total = K(layout);
      const own = share(layout, dof);
      const place = (layout.json.coordinates ?? []).indexOf(layout.dofs[dof]);
      if (place >= 0) add("position q", f("q", place), turn);
      add("velocity q̇", f("qd", dof), `${turn}/s`);
      add("total rate ν", f("nu", dof), "√J");
      add("energy share ½ν²", own, "J");
      add("… of K", (d, b) => own(d, b) / total(d, b), "", percent);
      add("joint torque τ", f("effort", dof), moment);
      if (layout.limits.effort?.[dof] > 0) add("… of its limit", ofLimit(layout, "effort", dof), "", percent);
      add("gravity torque", f("gravity_torque", dof), moment);
      add("external torque", f("external_torque", dof), moment, (x) => measure(x, layout.thresholds.external_torque?.[dof] ?? noise[moment]));
      add("residual r", f("residual", dof), "√J/s");
      add("working moment ε", f("epsilon", dof), "√J/s");
      add("gravity term ε_g", f("gravity", dof), "√J/s");
      add("Coriolis term C", f("coriolis", dof), "√J/s");
      add("exchange νC", exchange(layout, dof), "W");
      add("articulated inertia D", f("D", dof), slides ? "kg" : "kg m²");
    }
    const k = layout.links.indexOf(link);
    if (k >= 0) {
      add("link energy", f("link_energy", k), "J");
      const mass = layout.scene.links[k]?.mass;
      if (mass > 0) add("mass", () => mass, "kg");
      const origin = (d, b) => layout.placements(d, b)?.[k].slice(12, 15) ?? [NaN, NaN, NaN];
      add("x, y, z", origin, "m", (xyz) => xyz.map((x) => metres(x)).join(", "));
    }
    this.lines = lines;
    const joints = dof >= 0 && layout.dofs[dof] !== link ? `${layout.dofs[dof]} · ` : "";
    say(this.title, joints + link);
    this.list.replaceChildren(...lines.map((line) => el("div", {}, el("dt", { text: line.label }), el("dd", {}, line.cell, line.unit ? ` ${line.unit}` : ""))));
  }

  draw(rows, i) {
    if (this.node.hidden) return;
    const base = rows.base(i);
    for (const line of this.lines) say(line.cell, line.shown(line.get(rows.data, base)));
  }
}
