// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Keyboard shortcuts and their help.

import { el } from "./dom.js";

export class Keys {
  // actions: rows of [keys, what they do, function(event)]
  constructor(actions) {
    this.actions = new Map();
    this.dialog = el(
      "dialog",
      { class: "help", "aria-label": "keyboard shortcuts" },
      el("h2", { text: "Keyboard shortcuts" }),
      el("table", {}, ...actions.map(([keys, what]) => el("tr", {}, el("th", {}, ...keys.map((key) => el("kbd", { text: NAMES[key] ?? key }))), el("td", { text: what })))),
      el("p", { text: "Click a link or joint to show its quantities. Click a line of a legend to hide it, with Shift or twice to show it alone. Drag across a plot to zoom into that time. Turn the wheel over a plot to change the time window." }),
      el("p", {}, "Drag the robot to rotate it. Drag with the right button or two fingers to move it."),
      el("button", { text: "close", onclick: () => this.dialog.close() }),
    );
    for (const [keys, , act] of actions) for (const key of keys) this.actions.set(key, act);
    document.addEventListener("keydown", (event) => this.#press(event));
    document.addEventListener("click", ({ target, detail }) => detail && target.closest("button, summary")?.blur()); // keys are the page's again
  }

  help() {
    if (this.dialog.open) this.dialog.close();
    else this.dialog.showModal();
  }

  #press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || /SELECT|INPUT/.test(event.target.tagName)) return;
    if (event.key === " " && event.target.matches("button, summary")) return; // it presses the button
    if ((this.dialog.open && event.key !== "?") || document.querySelector(":popover-open")) return;
    const act = this.actions.get(event.key);
    if (!act) return;
    event.preventDefault();
    act(event);
  }
}

const NAMES = { " ": "space", ArrowLeft: "←", ArrowRight: "→", Escape: "Esc", Home: "Home", End: "End" };
