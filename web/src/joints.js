// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The table of joints: a row for each, with bars of what it has, gives, bears and is pushed by.

import { jointColour, OTHERS } from "./colours.js";
import { breakable, el, say, toggle } from "./dom.js";
import { number } from "./format.js";
import { barLength, columnsOf, largestOf, together } from "./bars.js";
import { largestJoints } from "./quantities.js";

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
    this.columns = columnsOf(layout);
    this.getters = this.columns.map((column) => layout.dofs.map((_, k) => column.get(k)));
    this.marks = this.columns.map((column) => layout.dofs.map((_, k) => column.mark?.(k)));
    this.bars = this.columns.map((column) => layout.dofs.map((_, k) => column.bar?.(k)));
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
    this.rest.node.title = "Show all. Energies and powers are sums, torques those of the joint nearest to its limit or threshold.";
    for (const cell of this.rest.cells) cell.node.append((cell.whose = el("small", { class: "whose" })));
    this.chosenAt = -Infinity;
  }

  #row(name, short, colour, chosen) {
    const cells = this.columns.map((column) => {
      const bar = el("i", { class: column.signed ? "bar both" : "bar", style: `background:${colour}` });
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
    const whole = Math.max(largestOf(values) * factor, 0.99 * (this.ends[column.id] ?? 0), 1e-9);
    const end = column.end ?? (this.ends[column.id] = whole);
    const length = (k, value) => (this.bars[c][k] ? barLength(this.bars[c][k](data, base), 1) : barLength(value * factor, end));
    const put = (cell, value, bar, mark, threshold) => {
      cell.bar.style.transform = `scaleX(${bar.toFixed(4)})`;
      say(cell.value, number(value * factor));
      if (column.mark) cell.mark.style.left = Number.isFinite(mark) ? `${50 + 50 * barLength(mark * factor, end)}%` : "-9px";
      toggle(cell.node, "above", threshold > 0 && Math.abs(value) > threshold);
    };
    for (const k of this.shown) {
      put(this.rows[k].cells[c], values[k], length(k, values[k]), this.marks[c][k]?.(data, base), column.thresholds?.[k]);
    }
    if (!this.others.length) return;
    const { value, dof } = together(column, values, this.others);
    const cell = this.rest.cells[c];
    put(cell, value, dof === null ? barLength(value * factor, end) : length(dof, value), NaN, column.thresholds?.[dof]);
    const whose = column.adds ? "sum" : value ? (this.layout.short[dof] ?? "") : ""; // nobody's, of zero
    if (cell.named !== whose) cell.whose.replaceChildren(...breakable(whose));
    cell.named = whose;
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
