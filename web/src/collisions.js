// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Collisions and contacts of the stored states: their list, and the force on the touched link.

import { breakable, el, say, toggle } from "./dom.js";
import { number, quantity, span } from "./format.js";
import { FLAGS } from "./layout.js";
import { field, hasThresholds } from "./quantities.js";
import { timeOfLargest } from "./sampling.js";

export const HOLD_OFF = 1.0; // [s]: what rises again within this time belongs to the event before, as in the monitor
const ROUNDING = 1e-6; // [s] of times in a summary
const REPORT_AGE = 2.0; // [s] between a collision and a report of it
const WIDE = 3.0; // ratio of the ends of an interval above which its upper end is not shown
const PERIOD = 1e-3; // [s]: events nearer than this to the moment shown are not next or previous

// Links that may be touched at a state, the most probable one first, with their probabilities, the 68 % interval of the force
// on any link, and the force at the centre of mass of the first one [N], NaN where a direction of it is not observed; null
// where no link is known.
function touchAt(layout, d, b) {
  const numbers = (name) => [...d.subarray(b + layout.at(name), b + layout.at(name) + layout.size(name))];
  const links = numbers("touched_link").map((place) => layout.links[place]).filter(Boolean);
  if (!links.length) return null;
  const [probabilities, interval, force] = ["touched_probability", "touch_interval", "touch_force"].map(numbers);
  return { links, probabilities, interval, force };
}

export const symmetric = ([xx, xy, xz, yy, yz, zz]) => [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];

// "hand 52 % or fore 31 %"
const linkText = ({ links, probabilities }) => links.map((link, k) => `${link}\u00a0${Math.round(100 * probabilities[k])}\u00a0%`).join(" or ");

// "12 to 25 N"; "≥ 12 N" of a wide interval.
function forceText({ interval: [low, high] }) {
  return high > WIDE * low ? `≥ ${quantity(low, "N", 2)}` : `${number(low, 2)} to ${quantity(high, "N", 2)}`;
}

// "collision: hand 52 % or fore 31 %, 12 to 25 N": the event wherever it is shown.
export const eventText = ({ kind, place, number }) => `${kind}: ${[place, number].filter(Boolean).join(", ")}`;

// Collisions, and contacts without one, in the order of time. Known ones are those of a summary, whose times are exact, and
// those that diagnostics report; others are runs of states that are flagged.
export function eventsOf(rows, layout, known = []) {
  const flags = field(layout, "flags");
  const runs = [];
  for (let i = 0; i < rows.length; i++) {
    const bits = flags(rows.data, rows.base(i)) & (FLAGS.contact | FLAGS.collision);
    if (!bits) continue;
    const [last, t] = [runs.at(-1), rows.time(i)];
    const kind = bits & FLAGS.collision || (last && t - last.end <= HOLD_OFF && last.kind === "collision") ? "collision" : "contact";
    if (last && t - last.end <= HOLD_OFF) Object.assign(last, { end: t, kind });
    else runs.push({ start: t, end: t, kind });
  }
  const beside = (all) => ({ start, end }) => !all.some((one) => one.start <= end + ROUNDING && one.end >= start - ROUNDING);
  const flagged = runs.filter(({ kind }) => kind === "collision");
  const isFlagged = (t) => flagged.some(({ start, end }) => start <= t + HOLD_OFF && t <= end + REPORT_AGE);
  const collisions = known.filter(({ kind, start, isReported }) => kind === "collision" && !(isReported && isFlagged(start)));
  const contacts = known.filter(({ kind }) => kind === "contact").filter(beside(collisions));
  const others = runs.filter(beside([...collisions, ...contacts]));
  return [...collisions, ...contacts, ...others].sort((a, b) => a.start - b.start).map((one) => described(rows, layout, one));
}

// With the place and the number of the event at its largest |r|: the touched link and its force, or else the joint whose
// external torque is the largest part of its threshold. A summary names the link.
function described(rows, layout, { start, end, kind, text = "", link = "", isReported = false }) {
  const [norm, touched] = [field(layout, "norm"), field(layout, "touched_link")];
  const atLink = (d, b) => (!link || layout.links[touched(d, b)] === link ? norm(d, b) : NaN);
  const times = [atLink, norm].map((get) => timeOfLargest(rows, start - ROUNDING, end + ROUNDING, get));
  const t = times.find(Number.isFinite) ?? start;
  const event = { start, end, t, kind, text, touch: null };
  if (isReported) return { ...event, place: text, number: "" };
  const [d, b] = [rows.data, rows.base(rows.nearest(t))];
  const touch = touchAt(layout, d, b);
  const torques = layout.dofs.map((_, k) => Math.abs(field(layout, "external_torque", k)(d, b)) || 0);
  const limits = layout.thresholds.external_torque ?? [];
  const isLimited = limits.some((limit) => limit > 0);
  const shares = torques.map((torque, k) => (isLimited ? torque / (limits[k] > 0 ? limits[k] : Infinity) : torque));
  const dof = shares.indexOf(Math.max(...shares));
  const torque = quantity(torques[dof], layout.json.angular?.[dof] === false ? "N" : "N m");
  if (!touch) return { ...event, place: layout.short[dof], number: torque };
  return { ...event, touch, place: linkText(touch), number: forceText(touch) };
}

export class CollisionList {
  // shared: rows(), layout(), view, collisions() of a summary, show(event)
  constructor(shared) {
    Object.assign(this, { shared, events: [], nodes: [], rows: new Map(), notes: null });
    const button = (text, step, title) => el("button", { class: "plain", text, title, "aria-label": title, onclick: () => this.step(step) });
    this.title = el("h2");
    this.says = el("div");
    this.body = el("tbody");
    const tools = el("span", { class: "steps" }, button("‹", -1, "previous collision or contact (b)"), button("›", 1, "next collision or contact (n)"));
    this.node = el(
      "section",
      { class: "card words", id: "collisions" },
      el("header", {}, this.title, tools),
      (this.box = el("div", { class: "text" }, this.says, el("table", { class: "contact" }, this.body))),
    );
  }

  // known: whether a report knows its collisions; texts: what it says of them.
  setNotes(known, texts) {
    this.notes = { known };
    this.says.replaceChildren(...texts.map((text) => el("p", {}, ...breakable(text))));
  }

  draw() {
    const { shared, notes } = this;
    const [rows, layout] = [shared.rows(), shared.layout()];
    this.events = eventsOf(rows, layout, shared.collisions());
    const count = (kind) => this.events.filter((one) => one.kind === kind).length;
    const [collisions, contacts] = [count("collision"), count("contact")];
    const plural = (n, word) => `${n || "No"} ${word}${n === 1 ? "" : "s"}`;
    const title = plural(collisions, "collision") + (contacts ? `, ${plural(contacts, "contact").toLowerCase()}` : "");
    say(this.title, notes && !notes.known ? "Collisions: unknown" : title);
    if (!notes) say(this.says, hasThresholds(layout) ? `in ${span(rows.last - rows.first)}` : "No thresholds are set (diag-dynamics calibrate).");
    const keys = this.events.map(({ start, end, t }) => JSON.stringify([start, end, t]));
    if (keys.join() === this.key) return;
    this.key = keys.join();
    this.rows = new Map(this.events.map((one, k) => [keys[k], this.rows.get(keys[k]) ?? this.#row(one)]));
    this.nodes = [...this.rows.values()];
    this.body.replaceChildren(...[...this.nodes].reverse()); // the newest one first
    this.place();
  }

  #row(one) {
    const { view, show } = this.shared;
    const duration = span(one.end - one.start);
    const time = el("button", { class: "link", text: view.label(one.start), title: "show the largest |r|" });
    return el(
      "tr",
      { title: [`${one.kind}, ${duration}`, one.text].filter(Boolean).join(": "), onclick: () => show(one) },
      el("th", { scope: "row" }, el("i", { class: `dot ${one.kind === "collision" ? "bad" : "warn"}` }), time, el("div", {}, ...breakable(one.place))),
      el("td", {}, one.number, el("small", {}, duration)),
    );
  }

  // The event of a moment, and until so many seconds after its end.
  at(t, after = PERIOD) {
    return this.events.find(({ start, end }) => t >= start - PERIOD && t <= end + after) ?? null;
  }

  // Marks the event of the moment.
  place() {
    const event = this.at(this.shared.view.now());
    this.events.forEach((one, k) => toggle(this.nodes[k], "chosen", one === event));
  }

  step(step) {
    const now = this.shared.view.now();
    const wanted = step > 0 ? this.events.find(({ t }) => t > now + PERIOD) : this.events.findLast(({ t }) => t < now - PERIOD);
    if (!wanted) return;
    this.shared.show(wanted);
    const row = this.nodes[this.events.indexOf(wanted)];
    if (row) this.box.scrollTop = row.offsetTop - this.box.clientHeight / 2; // the card alone, not the page
  }
}
