// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The card of predicted contact: one row per contact point, smallest margin first. Advisory.

import { breakable, el, say, toggle } from "./dom.js";
import { measure, number, shortNames } from "./format.js";
import { noiseOf } from "./quantities.js";

const SORT_PERIOD = 1000; // [ms]: rows keep their places so that one can be read and clicked
const COLUMNS = [
  ["margin", "m/s", "allowed speed minus speed; negative: a limit is exceeded"],
  ["speed", "m/s", "speed of the point along its motion"],
  ["mass", "kg", "reflected mass along the motion"],
  ["energy", "J", "energy that a contact along the motion can transfer"],
];

export class ContactCard {
  constructor(layout, select) {
    this.layout = layout;
    const { points } = layout.json.contact_limits;
    this.summary = el("p", { class: "none" });
    const heads = COLUMNS.map(([name, unit, help]) => el("th", { title: help }, `${name} `, el("small", { text: unit })));
    this.body = el("tbody");
    const table = el("table", { class: "contact" }, el("thead", {}, el("tr", {}, el("th", { text: "point" }), ...heads)), this.body);
    this.node = el(
      "section",
      { class: "card words", id: "contact-limits", title: "Rigid-body prediction, no safety function (docs/contact-limits.md)" },
      el("header", {}, el("h2", { text: "Predicted contact (advisory)" })),
      this.summary,
      el("div", { class: "text" }, table),
    );
    const short = shortNames(points.map(({ name }) => name));
    this.rows = points.map(({ name, link }, k) => {
      const cells = COLUMNS.map(() => el("td"));
      const label = el("th", { scope: "row" }, ...breakable(short[k]));
      return { cells, node: el("tr", { title: name, onclick: () => select(link) }, label, ...cells) };
    });
    this.sortedAt = -Infinity;
  }

  draw(data, base) {
    const { layout, rows } = this;
    const { points } = layout.json.contact_limits;
    const noise = noiseOf(layout);
    const all = (name) => data.subarray(base + layout.at(name), base + layout.at(name) + layout.size(name));
    const [worst] = all("contact_limits_worst");
    const [speed, mass, energy, allowed] = ["speed", "mass", "energy", "allowed"].map((name) => all(`contact_limits_${name}`));
    const margin = allowed.map((limit, k) => limit - Math.max(speed[k], 0));
    const known = Number.isFinite(worst);
    toggle(this.node, "old", !known);
    toggle(this.node, "free", allowed.every((limit) => !(limit < Infinity)));
    this.worst = worst >= 0 ? { position: [...all("contact_limits_position")], above: margin[worst] < 0 } : null;
    const least = points[worst] && (Number.isFinite(margin[worst])
      ? `smallest margin: ${points[worst].name}, ${number(margin[worst])} m/s`
      : `largest energy: ${points[worst].name}, ${number(energy[worst])} J; no limits set (contact_limits.file)`);
    say(this.summary, known ? (least ?? "at rest") : "no result at this time");
    rows.forEach(({ cells, node }, k) => {
      toggle(node, "above", margin[k] < 0);
      toggle(node, "chosen", k === worst);
      const values = [margin[k], speed[k], mass[k], energy[k]];
      values.forEach((value, column) => say(cells[column], measure(value, noise[COLUMNS[column][1]])));
    });
    if (performance.now() - this.sortedAt < SORT_PERIOD || this.body.matches(":hover")) return;
    this.sortedAt = performance.now();
    const size = (k) => [Number.isFinite(margin[k]) ? margin[k] : Infinity, -energy[k]];
    const order = rows.map((_, k) => k).sort((a, b) => size(a)[0] - size(b)[0] || size(a)[1] - size(b)[1]);
    if (order.join() !== this.order) this.body.replaceChildren(...order.map((k) => rows[k].node));
    this.order = order.join();
  }
}
