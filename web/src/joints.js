// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The table of joints: a row for each, with bars of what it has, gives, bears and is pushed by.

import { jointColour, OTHERS } from "./colours.js";
import { breakable, el, say, toggle } from "./dom.js";
import { number } from "./format.js";
import { exchange, hasLimits, largestJoints, ofLimit, share } from "./quantities.js";

const ALL = 14; // joints of which all are shown
const TOP = 10; // of more than these, so many
const RECHOSEN = 1500; // [ms] after which others may be among them

export class JointTable {
  constructor(layout, { select, selected }) {
    this.layout = layout;
    this.selected = selected;
    this.select = select;
    this.whole = layout.dofs.length <= ALL;
    this.recent = new Float64Array(layout.dofs.length); // largest shares, that fade
    this.ends = {};
    const limits = hasLimits(layout);
    this.columns = [
      { id: "share", title: "½ν²", unit: "J", get: (k) => share(layout, k) },
      { id: "exchange", title: "gives νC", unit: "W", both: true, get: (k) => exchange(layout, k) },
      limits
        ? { id: "torque", title: "torque", unit: "% of limit", both: true, factor: 100, end: 100, get: (k) => ofLimit(layout, "effort", k), mark: (k) => ofLimit(layout, "gravity_torque", k) }
        : { id: "torque", title: "torque", unit: "N m", both: true, get: (k) => at(layout, "effort", k), mark: (k) => at(layout, "gravity_torque", k) },
      { id: "external", title: "external", unit: "N m", both: true, get: (k) => at(layout, "external_torque", k), threshold: layout.thresholds.external_torque ?? [] },
    ];
    this.getters = this.columns.map((column) => layout.dofs.map((_, k) => column.get(k)));
    this.marks = this.columns.map((column) => layout.dofs.map((_, k) => column.mark?.(k)));
    this.body = el("tbody");
    this.node = el(
      "table",
      { class: "joints" },
      el(
        "thead",
        {},
        el("tr", {}, el("th", { text: `${layout.dofs.length} joints` }), ...this.columns.map((column) => el("th", {}, el("span", { text: column.title }), " ", el("small", { text: column.unit })))),
      ),
      this.body,
    );
    this.rows = layout.dofs.map((name, k) => this.#row(name, layout.short[k], jointColour(k), () => this.select(k)));
    this.rest = this.#row("", "", OTHERS, () => {
      this.whole = true;
      this.chosenAt = -Infinity;
    });
    this.rest.node.title = "show all";
    this.chosenAt = -Infinity;
  }

  #row(name, short, colour, chosen) {
    const cells = this.columns.map((column) => {
      const bar = el("i", { class: column.both ? "bar both" : "bar", style: `background:${colour}` });
      const mark = el("i", { class: "mark" });
      const value = el("b", { text: "–" });
      return { bar, mark, value, node: el("td", {}, el("div", {}, bar, ...(column.mark ? [mark] : []), value)) };
    });
    const label = el("span", {}, ...breakable(short));
    const node = el("tr", { title: name, onclick: chosen }, el("th", { scope: "row" }, el("div", {}, el("i", { class: "dot", style: `background:${colour}` }), label)), ...cells.map((cell) => cell.node));
    return { node, label, cells };
  }

  draw(rows, i) {
    const { data } = rows;
    const base = rows.base(i);
    const values = this.getters.map((getters) => getters.map((get) => get(data, base)));
    values[0].forEach((value, k) => (this.recent[k] = Math.max(value || 0, 0.995 * this.recent[k])));
    this.#choose();
    this.columns.forEach((column, c) => this.#column(column, c, values[c], data, base));
    this.rows.forEach((row, k) => toggle(row.node, "chosen", k === this.selected()));
    this.values = values;
  }

  #column(column, c, values, data, base) {
    const factor = column.factor ?? 1;
    const biggest = values.reduce((most, value) => Math.max(most, Math.abs(value) || 0), 0) * factor;
    const end = column.end ?? (this.ends[column.id] = Math.max(biggest, 0.99 * (this.ends[column.id] ?? 0), 1e-9));
    const put = (cell, value, mark, limit) => {
      const part = Number.isFinite(value) ? Math.max(-1, Math.min(1, (value * factor) / end)) : 0;
      cell.bar.style.transform = `scaleX(${part.toFixed(4)})`;
      say(cell.value, number(value * factor));
      if (column.mark) {
        const at = Number.isFinite(mark) ? Math.max(-1, Math.min(1, (mark * factor) / end)) : NaN;
        cell.mark.style.left = Number.isFinite(at) ? `${50 + 50 * at}%` : "-9px";
      }
      toggle(cell.node, "above", limit != null && Math.abs(value) > limit);
    };
    this.shown.forEach((k) => put(this.rows[k].cells[c], values[k], this.marks[c][k]?.(data, base), column.threshold?.[k]));
    if (this.others.length) put(this.rest.cells[c], this.others.reduce((sum, k) => sum + (values[k] || 0), 0), NaN, null);
  }

  // Those with most energy lately, in the robot's order.
  #choose() {
    const now = performance.now();
    if (this.shown && now - this.chosenAt < RECHOSEN) return;
    this.chosenAt = now;
    const all = this.layout.dofs.map((_, k) => k);
    const shown = this.whole ? all : largestJoints(this.recent, TOP, this.selected());
    if (this.shown?.join() === shown.join()) return;
    this.shown = shown;
    this.others = all.filter((k) => !shown.includes(k));
    say(this.rest.label, `${this.others.length} others`);
    this.body.replaceChildren(...shown.map((k) => this.rows[k].node), ...(this.others.length ? [this.rest.node] : []));
  }
}

function at(layout, name, k) {
  const place = layout.at(name, k);
  return (d, b) => d[b + place];
}
