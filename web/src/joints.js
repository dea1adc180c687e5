// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The table of joints: a row for each, with bars of its energy share, exchange, torque and external torque.

import { jointColour } from "./colours.js";
import { breakable, el, say, toggle } from "./dom.js";
import { measure, scaleOf } from "./format.js";
import { exchange, field, hasLimits, hasThresholds, noiseOf, ofLimit, ofThreshold, share, unitOf } from "./quantities.js";

const EXCHANGE = "power νC by the Coriolis term: positive if the joint gives, negative if it receives";

export class JointTable {
  constructor(layout, { select, selected }) {
    this.selected = selected;
    this.ends = {};
    this.columns = columnsOf(layout);
    this.noise = noiseOf(layout);
    const heads = this.columns.map(({ title, unit, help }) => el("th", { title: help }, `${title} `, el("small", { text: unit })));
    this.rows = layout.dofs.map((name, k) => this.#row(name, layout.short[k], k, () => select(k)));
    this.node = el(
      "table",
      { class: "joints" },
      el("caption", {}, el("h2", { text: "Energy and torque by joint" })),
      el("thead", {}, el("tr", {}, el("th", { text: "joint" }), ...heads)),
      el("tbody", {}, ...this.rows.map(({ node }) => node)),
    );
  }

  #row(name, short, k, onclick) {
    const colour = `background:${jointColour(k)}`;
    const cells = this.columns.map((column) => {
      const bar = el("i", { class: column.signed ? "level both" : "level", style: colour });
      const mark = column.mark && el("i", { class: "mark" });
      const value = el("b");
      const node = el("td", {}, el("div", {}, bar, ...(mark ? [mark] : []), value));
      return { bar, mark, value, node, get: column.get(k), getMark: column.mark?.(k), getBar: column.bar?.(k) };
    });
    const label = el("th", { scope: "row" }, el("div", {}, el("i", { class: "dot", style: colour }), el("span", {}, ...breakable(short))));
    return { cells, node: el("tr", { title: name, onclick }, label, ...cells.map((cell) => cell.node)) };
  }

  draw(rows, i) {
    const [data, base] = [rows.data, rows.base(i)];
    this.columns.forEach((column, c) => this.#column(column, this.rows.map(({ cells }) => cells[c]), data, base));
    this.rows.forEach(({ node }, k) => toggle(node, "chosen", k === this.selected()));
  }

  #column({ id, unit, factor = 1, end, thresholds }, cells, data, base) {
    const values = cells.map(({ get }) => get(data, base) * factor);
    this.ends[id] = end ?? Math.max(largestOf(values), 0.99 * (this.ends[id] ?? 0), this.noise[unit] ?? 1e-9);
    cells.forEach(({ bar, mark, value, node, getMark, getBar }, k) => {
      const length = getBar ? barLength(getBar(data, base), 1) : barLength(values[k], this.ends[id]);
      bar.style.transform = `scaleX(${length.toFixed(4)})`;
      say(value, measure(values[k], scaleOf(thresholds?.[k], this.ends[id])));
      if (mark) mark.style.left = `${50 + 50 * barLength(getMark(data, base) * factor, this.ends[id])}%`;
      toggle(node, "above", thresholds?.[k] > 0 && Math.abs(values[k]) > thresholds[k]);
    });
  }
}

// Columns: `get` and `mark` of a joint; `signed` for bars in both directions; a fixed `end` of bars; `thresholds` by joint;
// `bar`: length of a joint's bar where it is not the value.
export function columnsOf(layout) {
  const of = (name) => (k) => field(layout, name, k);
  const limited = (name) => (k) => ofLimit(layout, name, k);
  const unit = unitOf(layout, "N m", "N");
  const torque = { id: "torque", title: "torque", help: "joint torque; mark: gravity torque", signed: true };
  return [
    { id: "share", title: "energy", unit: "J", help: "energy share ½ν² of the total joint rate", get: (k) => share(layout, k) },
    { id: "exchange", title: "exchange", unit: "W", help: EXCHANGE, signed: true, get: (k) => exchange(layout, k) },
    hasLimits(layout)
      ? { ...torque, unit: "% of limit", factor: 100, end: 100, get: limited("effort"), mark: limited("gravity_torque") }
      : { ...torque, unit, get: of("effort"), mark: of("gravity_torque") },
    {
      id: "external",
      title: "external",
      unit,
      help: "external torque of the disturbance observer",
      signed: true,
      get: of("external_torque"),
      bar: hasThresholds(layout) ? (k) => ofThreshold(layout, k) : undefined,
      thresholds: layout.thresholds.external_torque ?? [],
    },
  ];
}

// The largest magnitude of the finite values.
export function largestOf(values) {
  return values.reduce((most, value) => (Number.isFinite(value) ? Math.max(most, Math.abs(value)) : most), 0);
}

// Length of a bar, −1 to 1; 0 if unknown.
export function barLength(value, end) {
  return Number.isFinite(value) && end > 0 ? Math.max(-1, Math.min(1, value / end)) : 0;
}
