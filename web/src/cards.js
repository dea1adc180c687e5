// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The cards: predicted contact, plots, diagnostics, results of a report. All plots share one cursor.

import { CollisionList } from "./collisions.js";
import { store, stored } from "./colours.js";
import { el, resized, say, toggle } from "./dom.js";
import { ContactCard } from "./contact-limits.js";
import { number, span, statusName, UNKNOWN } from "./format.js";
import { severity, statusText } from "./health.js";
import { Plot } from "./plot.js";
import { plotsOf } from "./quantities.js";

const BEFORE = 4; // plots before the list of collisions on a live page
const LEVELS = ["good", "warn", "bad", "warn"];

export class Cards {
  constructor(shared) {
    this.shared = shared;
    this.plots = [];
    this.legends = {}; // state of each plot's legend
    this.hidden = (stored("diag.hidden") ?? "").split(",").filter(Boolean); // names of cards
    this.large = null; // name of the card that fills the page
    this.menu = el("div", { class: "menu", id: "cardmenu", popover: "auto", onbeforetoggle: () => this.menu.replaceChildren(...[...this.node.children].map((card) => this.#choice(card))) });
    this.pointer = null; // function of the time below the pointer, or null
    this.list = el("div", { class: "diagnostics" }, el("p", { class: "none", text: "no diagnostics received yet" }));
    this.statuses = []; // each one with the element of its text
    this.pulse = el("p", { class: "pulse" });
    this.words = el("section", { class: "card words", id: "diagnostics" }, el("header", {}, el("h2", { text: "Diagnostics" })), this.list, this.pulse);
    this.collisions = new CollisionList(shared);
    this.chapters = []; // cards of a report
    this.node = el("div", { class: "cards" }, ...(shared.view.live ? [this.words] : [])); // with the reason why there is no robot yet
    resized(this.node, () => this.#fill());
  }

  setLayout(layout) {
    for (const plot of this.plots) plot.remove();
    this.pointer = null;
    this.plots = plotsOf(layout).map((spec) => new Plot(spec, this.shared, (this.legends[spec.id] ??= { hidden: new Set() })));
    this.contact = layout.size("contact_limits_worst") ? new ContactCard(layout, (link) => this.shared.selectLink(link)) : null;
    const contact = this.contact ? [this.contact.node] : [];
    const [first, ...others] = this.chapters;
    const plots = this.plots.map((plot) => plot.node);
    const list = this.collisions.node;
    if (first) this.node.replaceChildren(first, list, ...contact, ...others, ...plots);
    else this.node.replaceChildren(...contact, ...plots.slice(0, BEFORE), list, ...plots.slice(BEFORE), this.words);
    for (const card of this.node.children) this.#addButton(card);
    this.show({});
  }

  #addButton(card) {
    if (card.querySelector(".enlarge")) return;
    const enlarge = () => this.show({ large: this.large ? null : nameOf(card) });
    card.querySelector("h2").addEventListener("click", enlarge);
    card.querySelector("header").append(el("button", { class: "plain enlarge", title: "enlarge, and back (Esc)", "aria-label": "enlarge", text: "⤢", onclick: enlarge }));
  }

  // hidden: names of cards; large: name of the card that fills the page, or null.
  show({ hidden = this.hidden, large = this.large }) {
    const cards = [...this.node.children];
    Object.assign(this, { hidden, large: cards.some((card) => nameOf(card) === large) ? large : null });
    for (const card of cards) {
      card.hidden = this.large ? nameOf(card) !== this.large : hidden.includes(nameOf(card));
      toggle(card, "large", nameOf(card) === this.large);
    }
    toggle(document.body, "enlarged", Boolean(this.large));
    this.#fill();
  }

  #choice(card) {
    const name = nameOf(card);
    const onchange = ({ target }) => {
      const others = this.hidden.filter((other) => other !== name);
      this.show({ hidden: target.checked ? others : [...others, name] });
      store("diag.hidden", this.hidden.join());
    };
    return el("label", {}, el("input", { type: "checkbox", name, checked: !this.hidden.includes(name), onchange }), card.querySelector("h2").textContent);
  }

  // The last card spans the cells that the others leave free.
  #fill() {
    const cards = [...this.node.children].filter((card) => !card.hidden);
    const last = cards.pop();
    for (const card of this.node.children) card.style.gridColumn = ""; // else a wide one would add columns
    const columns = getComputedStyle(this.node).gridTemplateColumns.split(" ").length;
    const cells = cards.length + (columns > 1 && this.contact && !this.contact.node.hidden ? 1 : 0); // the contact card has two
    if (last) last.style.gridColumn = `span ${columns - (cells % columns)}`;
  }

  draw() {
    for (const plot of this.plots) plot.draw();
    if (!this.pointer) return;
    this.shared.view.point(this.pointer()); // time has gone on below it
    this.place();
  }

  place() {
    for (const plot of this.plots) plot.place();
  }

  restyle() {
    for (const plot of this.plots) plot.restyle();
  }

  // Adds the pointer to a plot: hovering moves the common cursor, dragging chooses a window, a click a moment.
  point(plot) {
    const { view } = this.shared;
    const { over } = plot.plot;
    const brush = el("div", { class: "brush", hidden: true });
    over.append(brush);
    const at = ({ clientX }) => {
      const x = clientX - over.getBoundingClientRect().left;
      return plot.base + plot.plot.posToVal(x, "x");
    };
    let begun = null;
    over.addEventListener("pointerdown", (event) => {
      if (event.button) return;
      begun = { x: event.offsetX, t: at(event) };
      over.setPointerCapture(event.pointerId);
    });
    over.addEventListener("pointermove", (event) => {
      const { clientX } = event;
      this.pointer = () => (over.isConnected ? at({ clientX }) : null);
      view.point(at(event));
      if (!begun || event.pointerType === "touch") return;
      const [x0, x1] = [begun.x, event.clientX - over.getBoundingClientRect().left].sort((a, b) => a - b);
      brush.hidden = x1 - x0 < 4;
      Object.assign(brush.style, { left: `${x0}px`, width: `${x1 - x0}px` });
    });
    over.addEventListener("pointerup", (event) => {
      const dragged = begun && !brush.hidden;
      const t = at(event);
      if (dragged) view.see(Math.min(begun.t, t), Math.max(begun.t, t));
      else if (begun) view.go(t);
      brush.hidden = true;
      begun = null;
    });
    over.addEventListener("pointercancel", () => {
      brush.hidden = true;
      begun = null;
    });
    over.addEventListener("pointerleave", () => {
      this.pointer = null;
      view.point(null);
    });
    over.addEventListener(
      "wheel",
      (event) => {
        if (!event.shiftKey && !event.ctrlKey && scrolls(this.node)) return; // the wheel is for the cards, then
        event.preventDefault();
        view.zoom(view.length * 1.25 ** Math.sign(event.deltaY), at(event));
      },
      { passive: false },
    );
    over.addEventListener("dblclick", () => (view.live ? view.follow() : view.whole()));
  }

  diagnosed(list) {
    const text = JSON.stringify(list);
    if (text === this.text) return;
    this.text = text;
    this.statuses = [];
    const order = [...list].sort((a, b) => severity(b) - severity(a));
    const rows = order.map((status) => {
      const { level, name, values } = status;
      const says = el("span");
      this.statuses.push([status, says]);
      const detail = Object.entries(values ?? {});
      const head = el("summary", {}, el("i", { class: `dot ${LEVELS[level] ?? "bad"}` }), el("b", { text: statusName(name), title: name }), says);
      const body = el("dl", {}, ...detail.map(([key, value]) => el("div", {}, el("dt", { text: key }), el("dd", { text: String(value) }))));
      return el("details", { open: this.open?.has(name) ?? false, ontoggle: (event) => this.#keep(name, event.target.open) }, head, body);
    });
    this.list.replaceChildren(...rows);
    this.nameEvents();
  }

  // Says in the statuses what the last collision or contact is called in its list.
  nameEvents() {
    for (const [status, says] of this.statuses) say(says, statusText(status, this.collisions.events.at(-1)));
  }

  showDiagnostics() {
    this.show({ hidden: this.hidden.filter((name) => name !== "diagnostics"), large: null });
    this.words.scrollIntoView({ block: "nearest", behavior: "smooth" });
  }

  #keep(name, open) {
    this.open ??= new Set();
    if (open) this.open.add(name);
    else this.open.delete(name);
  }

  // shown: frames received per second.
  beat({ age, rate, hz }, shown) {
    const parts = [`${number(rate)} states/s received`, `${number(shown)} of ${number(hz)} frames/s shown`];
    parts.push(`last state ${age === null || age === undefined ? UNKNOWN : span(age)} old`);
    say(this.pulse, parts.join(" · "));
  }
}

const nameOf = (card) => card.id.replace("plot-", "");

function scrolls(node) {
  return node.scrollHeight > node.clientHeight + 2 || document.documentElement.scrollHeight > innerHeight + 2;
}
