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
import { cardsOf, DEFAULT, gridOf, PRESETS, textOf } from "./presets.js";
import { plotsOf } from "./quantities.js";

const BEFORE = 4; // plots before the list of collisions on a live page
const NOTES = 2; // chapters of a report after its plots: data quality, parameters
const LEVELS = ["good", "warn", "bad", "warn"];
const MIN_WIDTH = 19; // [rem] of a card

export class Cards {
  constructor(shared) {
    this.shared = shared;
    this.plots = [];
    this.legends = {}; // state of each plot's legend
    this.chosen = cardsOf(stored("diag.cards") ?? DEFAULT) ?? PRESETS[DEFAULT]; // names of cards
    this.large = null; // name of the card that fills the page
    this.menu = el("div", { class: "menu", id: "cardmenu", popover: "auto", onbeforetoggle: () => this.#fillMenu() });
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
    const [first, ...results] = this.chapters.slice(0, -NOTES);
    const notes = this.chapters.slice(-NOTES);
    const plots = this.plots.map((plot) => plot.node);
    const list = this.collisions.node;
    if (first) this.node.replaceChildren(first, list, ...results, ...contact, ...plots, ...notes);
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

  // The preset or the names of the cards that are shown, as text.
  get choice() {
    return textOf(this.chosen);
  }

  // chosen: names of cards; large: name of the card that fills the page, or null.
  show({ chosen = this.chosen, large = this.large }) {
    const cards = [...this.node.children];
    Object.assign(this, { chosen, large: cards.some((card) => nameOf(card) === large) ? large : null });
    for (const card of cards) {
      card.hidden = this.large ? nameOf(card) !== this.large : !chosen.includes(nameOf(card));
      toggle(card, "large", nameOf(card) === this.large);
    }
    toggle(document.body, "enlarged", Boolean(this.large));
    this.#fill();
  }

  // Shows these cards also when the page is opened again.
  choose(chosen) {
    this.show({ chosen, large: null });
    store("diag.cards", this.choice);
    this.#markMenu();
  }

  // Fills the menu: presets, and each card of the robot.
  #fillMenu() {
    const presets = Object.keys(PRESETS).map((preset) => el("button", { text: preset, onclick: () => this.choose(PRESETS[preset]) }));
    this.menu.replaceChildren(el("div", { class: "presets" }, ...presets), ...[...this.node.children].map((card) => this.#menuLine(card)));
    this.#markMenu();
  }

  #menuLine(card) {
    const name = nameOf(card);
    const onchange = ({ target }) => this.choose(target.checked ? [...this.chosen, name] : this.chosen.filter((other) => other !== name));
    return el("label", {}, el("input", { type: "checkbox", name, onchange }), card.querySelector("h2").textContent);
  }

  #markMenu() {
    for (const input of this.menu.querySelectorAll("input")) input.checked = this.chosen.includes(input.name);
    for (const button of this.menu.querySelectorAll("button")) button.setAttribute("aria-pressed", button.textContent === this.choice);
  }

  #fill() {
    const cards = [...this.node.children].filter((card) => !card.hidden);
    const size = parseFloat(getComputedStyle(this.node).fontSize);
    const most = Math.max(1, Math.floor(this.node.clientWidth / (MIN_WIDTH * size)));
    const { columns, spans } = gridOf(cards.map(kindOf), most);
    this.node.style.gridTemplateColumns = `repeat(${columns}, minmax(0, 1fr))`;
    cards.forEach((card, k) => (card.style.gridColumn = `span ${spans[k]}`));
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
    this.show({ chosen: [...new Set([...this.chosen, "diagnostics"])], large: null });
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
const kindOf = ({ id }) => (id.startsWith("plot-") ? "plot" : id === "contact-limits" ? "table" : "words");

function scrolls(node) {
  return node.scrollHeight > node.clientHeight + 2 || document.documentElement.scrollHeight > innerHeight + 2;
}
