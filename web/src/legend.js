// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The legend of a plot: its lines with their values at the cursor. A click hides or shows a line; with Shift, or twice, it is alone.

import { el, say, toggle } from "./dom.js";
import { measure, scaleOf } from "./format.js";

// The hidden lines after a click on a line. alone: all others are hidden, or shown if they all were hidden.
export function clicked(hidden, names, name, alone) {
  const others = names.filter((other) => other !== name);
  if (!alone) return new Set(hidden.has(name) ? [...hidden].filter((other) => other !== name) : [...hidden, name]);
  return new Set(!hidden.has(name) && others.every((other) => hidden.has(other)) ? [] : others);
}

export class Legend {
  // state: {hidden}, names of hidden lines, which outlives this legend; names: of all lines of the plot
  constructor(state, names, changed) {
    Object.assign(this, { state, names, changed, chips: [], cells: [] });
    const click = (alone) => (event) => this.#click(event.target.closest("button"), alone || event.shiftKey);
    this.node = el("div", { class: "legend", onclick: click(false), ondblclick: click(true) });
  }

  isShown({ name }) {
    return !this.state.hidden.has(name);
  }

  // omitted: number of lines that the plot omits.
  setLines(lines, omitted) {
    this.lines = lines;
    this.cells = lines.map(() => el("b", { text: "–" }));
    this.chips = lines.map((line, k) =>
      el(
        "button",
        { class: "chip", title: `${line.name}: click to hide or show, Shift and click or double-click to show it alone` },
        el("i", { style: `background:${line.colour}` }),
        el("span", { text: line.short }),
        this.cells[k],
      ),
    );
    this.#mark();
    this.node.replaceChildren(...this.chips, ...(omitted ? [el("span", { class: "chip", text: `+ ${omitted} smaller` })] : []));
  }

  // ends: of the lines' axes; NaN of a logarithmic one.
  setValues(values, ends) {
    values.forEach((value, k) => {
      const { threshold } = this.lines[k];
      say(this.cells[k], measure(value, scaleOf(threshold, ends[k])));
      toggle(this.chips[k], "above", threshold != null && Math.abs(value) > threshold);
    });
  }

  #click(chip, alone) {
    if (!chip) return;
    this.state.hidden = clicked(this.state.hidden, this.names, this.lines[this.chips.indexOf(chip)].name, alone);
    this.#mark();
    this.changed();
  }

  #mark() {
    this.chips.forEach((chip, k) => chip.setAttribute("aria-pressed", this.isShown(this.lines[k])));
  }
}
