// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// What a touch would cost, point by point: a card that is there once a monitor tells of it, and in a report. Advisory, and
// says so.

import { breakable, el, say, scrolling, toggle } from "./dom.js";
import { number, shortNames } from "./format.js";
import { byMargin, inWords, Touches } from "./touches.js";

const OLD = 2000; // [ms] after which what was told last is no longer shown
const KEPT = 300; // [s] that can be scrubbed back
const RATE = 10; // [Hz] at which it is told at most
const SORTED = 1000; // [ms] after which rows may change their places, so that one can be read and clicked
const POINTER = matchMedia("(hover: hover)"); // on a phone what was touched last counts as pointed at
const COLUMNS = [
  ["margin", "m/s", "allowed speed less speed: below zero a limit is exceeded"],
  ["speed", "m/s", "along the point's motion"],
  ["mass", "kg", "reflected mass along the motion"],
  ["energy", "J", "contact energy: the energy that a contact along the motion can transfer"],
  ["by M/2", "J", "energy of half the moving mass and the payload at this speed (ISO/TS 15066)"],
];

export class ContactCard {
  constructor(select) {
    this.select = select;
    this.newest = null; // {t, half, worst, points} as the server tells it
    this.shown = null; // likewise, of the moment that is looked at
    this.arrived = this.sortedAt = -Infinity;
    this.stored = new Touches(KEPT, RATE); // of a report, Kept
    this.says = el("p", { class: "none" });
    this.body = el("tbody");
    const heads = COLUMNS.map(([name, unit, help]) => el("th", { title: help }, `${name} `, el("small", { text: unit })));
    const table = el("table", { class: "touch" }, el("thead", {}, el("tr", {}, el("th", { text: "point" }), ...heads)), this.body);
    this.node = el(
      "section",
      { class: "card words", id: "contact", title: "Rigid bodies; no safety function: see docs/contact.md" },
      el("header", {}, (this.title = el("h2"))),
      this.says,
      scrolling(el("div", { class: "text" }, table)),
    );
    this.rows = [];
    this.labels = new Map();
  }

  take(json) {
    this.newest = json;
    this.arrived = performance.now();
    this.stored.take(json);
  }

  // Of a report: nothing comes, all is there.
  keep(kept) {
    this.stored = this.kept = kept;
  }

  // Whether there is anything to be shown.
  get told() {
    return Boolean(this.newest ?? this.kept);
  }

  forget() {
    this.newest = this.shown = null;
    this.stored.forget();
  }

  // While somebody looks at what is stored, nothing of it is dropped.
  hold(held) {
    if (!this.kept) this.stored.rows.held = held;
  }

  get fresh() {
    return this.newest !== null && performance.now() - this.arrived < OLD;
  }

  // The worst point of the moment that is looked at: {position, above}, or null.
  get worst() {
    const { points, worst } = this.shown ?? {};
    return points?.[worst] ? { position: points[worst].position, above: points[worst].margin < 0 } : null;
  }

  // moment: that is looked at; null: now. moves: whether it goes on by itself.
  draw(moment, moves) {
    if (!this.told) return;
    const told = moment === null ? this.newest : this.stored.at(moment);
    this.shown = moment === null && !this.fresh ? null : told;
    say(this.title, moment === null ? "Predicted contact now (advisory)" : "Predicted contact at this moment (advisory)");
    toggle(this.node, "old", !this.shown);
    if (!told) say(this.says, "no predicted contact at this moment");
    if (!told || (told.t === this.drawn?.t && told.points.length === this.drawn.points.length)) {
      if (told) say(this.says, this.drawn.said);
      return;
    }
    const { points, half, worst, estimated } = told;
    const least = points[worst];
    const free = points.every((point) => point.allowed === null);
    toggle(this.node, "free", free);
    this.drawn = { ...told, said: [inWords(least, free), `M/2 + payload: ${number(half)} kg`, ...this.#notes(estimated)].join(" · ") };
    say(this.says, this.drawn.said);
    const short = shortNames(points.map((point) => point.name));
    this.#sort(points, moment !== null && !moves);
    while (this.rows.length < points.length) this.rows.push(this.#row());
    this.rows.length = points.length;
    this.order.forEach((k, place) => this.#fill(this.rows[place], points[k], short[k], half, k === worst));
    if (this.body.childElementCount !== points.length) this.body.replaceChildren(...this.rows.map((row) => row.node));
  }

  #notes(estimated) {
    const links = this.kept?.leftOut;
    const frames = links ? [`without the shapes of ${links === 1 ? "a link" : `${links} links`} (contact.geometry)`] : [];
    return estimated ? ["velocities estimated", ...frames] : frames;
  }

  // Those with the least margin first; as they were while somebody points at one, and for a time.
  #sort(points, atOnce) {
    const now = performance.now();
    const same = this.order?.length === points.length;
    if (same && !atOnce && (now - this.sortedAt < SORTED || (POINTER.matches && this.body.matches(":hover")))) return;
    this.sortedAt = now;
    this.order = byMargin(points);
  }

  #row() {
    const row = { name: el("th", { scope: "row" }), cells: COLUMNS.map(() => el("td")) };
    row.node = el("tr", { onclick: () => this.select(row.link) }, row.name, ...row.cells);
    return row;
  }

  // A point's name, which goes from row to row with it: making it anew takes more time than all numbers.
  #label(name, short) {
    if (this.labels.get(name)?.textContent !== short) this.labels.set(name, el("span", {}, ...breakable(short)));
    return this.labels.get(name);
  }

  #fill(row, { name, link, margin, speed, mass, energy }, short, half, worst) {
    row.link = link;
    if (row.named !== name) row.name.replaceChildren(this.#label(name, short));
    row.named = row.node.title = name;
    toggle(row.node, "above", margin !== null && margin < 0);
    toggle(row.node, "chosen", worst);
    [margin, speed, mass, energy, 0.5 * half * speed * speed].forEach((value, k) => say(row.cells[k], number(value)));
  }
}
