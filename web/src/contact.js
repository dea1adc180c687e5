// What a touch would cost, point by point: a card that is there once a monitor tells of it. Advisory, and says so.

import { breakable, el, say, scrolling, toggle } from "./dom.js";
import { number, shortNames } from "./format.js";

const OLD = 2000; // [ms] after which what was told last is no longer shown
const COLUMNS = [
  ["margin", "m/s", "allowed speed less speed: below zero a limit is exceeded"],
  ["speed", "m/s", "along the point's motion"],
  ["mass", "kg", "that a contact along the motion meets"],
  ["energy", "J", "that a contact along the motion can take out of the robot"],
  ["by M/2", "J", "the energy that half the robot's moving mass, and its payload, would have at this speed"],
];

export class ContactCard {
  constructor(select) {
    this.select = select;
    this.newest = null; // {t, half, worst, points} as the server tells it
    this.arrived = -Infinity;
    this.says = el("p", { class: "none" });
    this.body = el("tbody");
    const heads = COLUMNS.map(([name, unit, help]) => el("th", { title: help }, `${name} `, el("small", { text: unit })));
    const table = el("table", { class: "touch" }, el("thead", {}, el("tr", {}, el("th", { text: "point" }), ...heads)), this.body);
    this.node = el(
      "section",
      { class: "card words", id: "contact", title: "Rigid bodies; no safety function: see docs/contact.md" },
      el("header", {}, el("h2", { text: "If it touched now (advisory)" })),
      this.says,
      scrolling(el("div", { class: "text" }, table)),
    );
    this.rows = [];
  }

  take(json) {
    this.newest = json;
    this.arrived = performance.now();
  }

  forget() {
    this.newest = null;
  }

  get fresh() {
    return this.newest !== null && performance.now() - this.arrived < OLD;
  }

  // The worst point: {position, above}, or null.
  get worst() {
    const { points, worst } = this.newest ?? {};
    return this.fresh && points[worst] ? { position: points[worst].position, above: points[worst].margin < 0 } : null;
  }

  draw() {
    toggle(this.node, "old", !this.fresh);
    if (!this.newest || this.newest === this.drawn) return;
    this.drawn = this.newest;
    const { points, half, worst, estimated } = this.newest;
    const short = shortNames(points.map((point) => point.name));
    const order = points.map((_, k) => k).sort((a, b) => (points[a].margin ?? Infinity) - (points[b].margin ?? Infinity) || points[b].energy - points[a].energy);
    while (this.rows.length < points.length) this.rows.push(this.#row());
    this.rows.length = points.length;
    order.forEach((k, place) => this.#fill(this.rows[place], points[k], short[k], half, k === worst));
    if (this.body.childElementCount !== points.length) this.body.replaceChildren(...this.rows.map((row) => row.node));
    const least = points[worst];
    const what = least ? (least.margin === null ? "no limits" : `least margin: ${least.name}, ${number(least.margin)} m/s`) : "at rest";
    say(this.says, `${what} · M/2 + payload: ${number(half)} kg${estimated ? " · velocities estimated" : ""}`);
  }

  #row() {
    const row = { name: el("span"), cells: COLUMNS.map(() => el("td")) };
    row.node = el("tr", { onclick: () => this.select(row.link) }, el("th", { scope: "row" }, row.name), ...row.cells);
    return row;
  }

  #fill(row, { name, link, margin, speed, mass, energy }, short, half, worst) {
    row.link = link;
    if (row.shown !== name) row.name.replaceChildren(...breakable(short));
    row.shown = row.node.title = name;
    toggle(row.node, "above", margin !== null && margin < 0);
    toggle(row.node, "chosen", worst);
    [margin, speed, mass, energy, 0.5 * half * speed * speed].forEach((value, k) => say(row.cells[k], number(value)));
  }
}
