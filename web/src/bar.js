// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The head of the page (robot, state, tools) and the transport buttons beside the timeline.

import { el, say } from "./dom.js";
import { clock, shortened } from "./format.js";

const WINDOWS = [5, 10, 30, 60, 120, 300];
const SENTENCE = 60; // letters of the worst status: beside a collision in one line of 1440 pixels
const LINES = 3; // of such letters on a narrow screen, where the status has lines of its own

export class Bar {
  constructor(app) {
    this.app = app;
    this.robots = el("select", { title: "robot (r)", "aria-label": "robot", onchange: () => app.source.choose(this.robots.value) });
    this.robots.hidden = true;
    this.all = el("button", { text: "All", title: "all robots in one scene (a)", hidden: true, onclick: () => app.showAll(!app.stage.fleet?.on) });
    this.name = el("b", { class: "robot" });
    this.pill = el("span", { class: "pill", role: "status" }, el("i"), (this.word = el("b")), (this.says = el("span")));
    this.notes = el("span", { class: "notes" });
    this.notice = el("button", { class: "notice", title: "about the link; click to close", onclick: () => (this.notice.hidden = !(app.notice = "")) });
    this.worst = el("button", { class: "worst", hidden: true, onclick: () => app.cards.showDiagnostics() });
    this.length = el("select", { title: "time window (+ −)", "aria-label": "time window", onchange: () => app.view.zoom(Number(this.length.value)) }, ...WINDOWS.map((s) => el("option", { value: s, text: s < 60 ? `${s} s` : `${s / 60} min` })));
    this.other = el("option", { hidden: true });
    this.length.append(this.other);
    const button = (text, title, onclick) => el("button", { text, title, onclick });
    this.node = el(
      "div",
      { class: "bar" },
      el("span", { class: "brand", text: "diag_dynamics" }),
      this.name,
      this.robots,
      this.all,
      this.pill,
      this.notes,
      this.worst,
      this.notice,
      el("span", { class: "tools end" }, (this.look = button("◐", "light or dark theme (t)", () => app.theme.next())), button("?", "keyboard shortcuts (?)", () => app.keys.help())),
    );
    this.go = button("", "", () => app.toggle());
    this.time = el("span", { class: "time" });
    this.push = button("Push", "push the simulated robot (p)", () => app.source.push());
    this.push.className = "push";
    this.live = button("live", "go back to live (l)", () => app.view.follow());
    this.transport = el("div", { class: "transport" }, this.go, this.time, ...(app.report ? [] : [this.live]));
    const tools = [
      ...(app.report ? [] : [this.push, this.length]),
      el("button", { text: "Cards", title: "choose cards", popovertarget: "cardmenu" }),
      button("Link", "copy a link to what is shown (y)", () => app.copyLink()),
      button("CSV", "download the time window as CSV (c)", () => app.csv()),
    ];
    this.tools = el("span", { class: "tools" }, ...tools);
    this.narrow = matchMedia("(max-width: 56rem)");
    this.narrow.addEventListener("change", () => this.#arrange());
    this.#arrange();
  }

  // On a narrow screen the tools are beside the transport buttons.
  #arrange() {
    if (this.narrow.matches) this.transport.append(this.tools);
    else this.look.before(this.tools);
  }

  listed(robots, chosen) {
    const known = [...this.robots.options].map((option) => option.value + option.textContent).join("\n");
    const options = robots.map((robot) => ({ value: robot.name, text: (robot.name || "/") + (robot.alive ? "" : " (no data)") }));
    if (known !== options.map(({ value, text }) => value + text).join("\n")) {
      this.robots.replaceChildren(...options.map((one) => el("option", one)));
    }
    this.robots.value = chosen;
    this.robots.hidden = this.all.hidden = robots.length < 2;
  }

  nextRobot() {
    const { options, selectedIndex } = this.robots;
    if (options.length > 1) this.app.source.choose(options[(selectedIndex + 1) % options.length].value);
  }

  draw() {
    const { app } = this;
    const { view } = app;
    const { level, word, says, notes, worst } = app.verdict();
    this.pill.className = `pill ${level}`;
    say(this.word, word);
    say(this.says, says);
    const shown = notes.map((note) => note.level + note.text).join();
    if (shown !== this.shown) {
      this.shown = shown;
      this.notes.replaceChildren(...notes.map((note) => el("span", { class: `note ${note.level}`, text: note.text })));
    }
    this.push.hidden = !app.health.heart?.pushes;
    this.all.setAttribute("aria-pressed", Boolean(app.stage.fleet?.on));
    this.notice.hidden = !app.notice;
    say(this.notice, app.notice);
    this.worst.hidden = !worst;
    if (worst) {
      this.worst.className = `worst ${worst.level}`;
      this.worst.title = worst.text;
      say(this.worst, shortened(worst.text, this.narrow.matches ? LINES * SENTENCE : SENTENCE));
    }
    say(this.name, app.layout?.json.robot ?? "");
    const playing = app.report ? app.source?.playing : !view.paused;
    say(this.go, playing ? "❚❚" : "▶");
    this.go.title = playing ? "pause (space)" : "continue (space)";
    say(this.time, app.rows.length ? view.label(view.shown()) : clock(NaN));
    this.live.style.visibility = view.paused ? "visible" : "hidden"; // the strip beside it must not move
    const named = WINDOWS.includes(view.length);
    if (!named) say(this.other, `${view.length.toPrecision(3)} s`);
    this.other.hidden = named;
    this.length.value = named ? String(view.length) : this.other.value;
  }
}
