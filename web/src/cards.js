// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The right of the page: cards of plots, of diagnostics, and of what a report tells; one cursor common to all.

import { el, resized, say, scrolling } from "./dom.js";
import { ContactCard } from "./contact.js";
import { number, span, statusName, UNKNOWN } from "./format.js";
import { Plot } from "./plot.js";
import { plotsOf } from "./quantities.js";

const NARROW = 18; // [rem] of a card
const LOW = 12;
const LEVELS = ["good", "warn", "bad", "bad"];

export class Cards {
  constructor(shared) {
    this.shared = shared;
    this.plots = [];
    this.pointer = null; // the time below the pointer: a function, or null
    this.said = el("div", {}, el("p", { class: "none", text: "no diagnostics received yet" }));
    this.list = scrolling(el("div", { class: "diagnostics" }, this.said));
    this.pulse = el("p", { class: "pulse" });
    this.words = el("section", { class: "card words", id: "diagnostics" }, el("header", {}, el("h2", { text: "Diagnostics" })), this.list, this.pulse);
    this.told = []; // cards of a report
    this.node = el("div", { class: "cards" }, ...(shared.view.live ? [this.words] : [])); // before there is a robot: why there is none
    resized(this.node, () => this.#arrange());
  }

  // As many columns as leave few places empty, and cards about twice as wide as high.
  #arrange() {
    const wide = this.contact ? 1 : 0; // it takes two places where there are two columns
    const places = (columns) => this.node.childElementCount + (columns > 1 ? wide : 0);
    const rem = parseFloat(getComputedStyle(document.documentElement).fontSize);
    const [width, height] = [this.node.clientWidth, this.node.clientHeight];
    let [best, columns] = [Infinity, 1];
    for (let c = 1; c === 1 || width / c >= NARROW * rem; c++) {
      const count = places(c);
      const lines = Math.ceil(count / c);
      const high = Math.max(LOW * rem, height / lines);
      const score = Math.abs(Math.log(width / c / high / 2)) + (0.5 * (lines * c - count)) / c + (lines * LOW * rem > height + 1 ? 0.2 : 0);
      if (score < best) [best, columns] = [score, c];
    }
    this.node.style.setProperty("--columns", columns);
    this.node.style.setProperty("--two", Math.min(2, columns));
  }

  setLayout(layout) {
    for (const plot of this.plots) plot.remove();
    this.pointer = null;
    this.plots = plotsOf(layout).map((spec) => new Plot(spec, this.shared));
    this.contact = layout.size("contact_worst") ? new ContactCard(layout, (link) => this.shared.selectLink(link)) : null;
    const contact = this.contact ? [this.contact.node] : [];
    const [first, ...others] = this.told; // what happened, before all else
    this.node.replaceChildren(...(first ? [first] : []), ...contact, ...others, ...this.plots.map((plot) => plot.node), ...(this.told.length ? [] : [this.words]));
    this.#arrange();
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

  // Has a plot listen to the pointer: hovering moves the cursor of all, dragging chooses a time, a click goes to it.
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
    const order = [...list].sort((a, b) => b.level - a.level);
    const rows = order.map(({ level, name, message, values }) => {
      const detail = Object.entries(values ?? {});
      const head = el("summary", {}, el("i", { class: `dot ${LEVELS[level] ?? "bad"}` }), el("b", { text: statusName(name), title: name }), el("span", { text: message }));
      const body = el("dl", {}, ...detail.map(([key, value]) => el("div", {}, el("dt", { text: key }), el("dd", { text: String(value) }))));
      return el("details", { open: this.open?.has(name) ?? false, ontoggle: (event) => this.#keep(name, event.target.open) }, head, body);
    });
    const text = JSON.stringify(list);
    if (text === this.text) return;
    this.text = text;
    this.said.replaceChildren(...rows);
  }

  // Brings what the nodes say into sight.
  showDiagnostics() {
    this.words.scrollIntoView({ block: "nearest", behavior: "smooth" });
  }

  #keep(name, open) {
    this.open ??= new Set();
    if (open) this.open.add(name);
    else this.open.delete(name);
  }

  // about: the server's heartbeat; drawn: frames that have come in a second.
  beat({ age, rate, hz }, drawn) {
    const parts = [`${number(rate)} states/s received`, `${number(drawn)} of ${number(hz)} frames/s shown`];
    parts.push(`last state ${age === null || age === undefined ? UNKNOWN : span(age)} old`);
    say(this.pulse, parts.join(" · "));
  }
}

function scrolls(node) {
  return node.scrollHeight > node.clientHeight + 2 || document.documentElement.scrollHeight > innerHeight + 2;
}
