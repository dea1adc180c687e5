// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The page: what it consists of, who hears of what, and when what is drawn anew.

import { Bar } from "./bar.js";
import { Cards } from "./cards.js";
import { Theme } from "./colours.js";
import { csv } from "./csv.js";
import { Details } from "./details.js";
import { readOnly } from "./diag.js";
import { download, el, toggle } from "./dom.js";
import { Health } from "./health.js";
import { JointTable } from "./joints.js";
import { Keys } from "./keys.js";
import { Stage } from "./stage.js";
import { Timeline } from "./timeline.js";
import { View } from "./view.js";

const PLOTS = 90; // [ms] between two drawings of what moves, and of the rest
const NUMBERS = 120;
const ROBOT = 33;
const STRIP = 1000;

export class App {
  constructor(body, { report, errors }) {
    this.report = report;
    this.health = new Health();
    this.layout = null;
    this.chosen = { link: null, dof: -1 };
    this.due = { plots: 0, numbers: 0, robot: 0, strip: 0 };
    this.wanted = { plots: true, numbers: true, robot: true, strip: true };
    this.cost = { step: NaN };
    this.theme = new Theme(() => this.restyle?.());
    this.view = new View(() => this.rows, !report, (what) => this.#moved(what));
    const shared = {
      theme: this.theme,
      view: this.view,
      rows: () => this.rows,
      layout: () => this.layout,
      select: (dof) => this.selectDof(dof),
      selected: () => this.chosen.dof,
      selectLink: (link) => this.select(link),
      contacts: () => this.source?.contacts ?? [],
      point: (plot) => this.cards.point(plot),
    };
    this.stage = new Stage({ ...shared, app: this });
    this.cards = new Cards(shared);
    this.timeline = new Timeline(shared);
    this.keys = new Keys(this.#actions());
    this.bar = new Bar(this);
    this.tableBox = el("div", { class: "tablebox" });
    this.left = el("div", { class: "left" }, this.stage.node, this.tableBox);
    this.main = el("main", {}, this.left, this.cards.node);
    this.foot = el("footer", {}, this.bar.transport, this.timeline.node);
    body.append(this.bar.node, this.main, this.foot, this.keys.dialog);
    toggle(body, "report", report);
    this.restyle = () => {
      this.stage.restyle();
      this.cards.restyle();
      this.#want("plots", "numbers", "robot", "strip");
    };
    this.stage.restyle();
    readOnly(this, errors);
    addEventListener("resize", () => this.#want("plots", "strip"));
  }

  begin(source) {
    this.source = source;
    source.begin();
    const loop = (now) => {
      requestAnimationFrame(loop);
      this.#draw(now);
    };
    requestAnimationFrame(loop);
    setInterval(() => this.touch(), 500);
  }

  get rows() {
    return this.source?.rows ?? NOTHING;
  }

  // --- what the source tells ---

  // same: the robot that was there before, of which more is known now.
  laidOut(layout, same = false) {
    this.layout = layout;
    if (!same) this.chosen = { link: null, dof: -1 };
    this.details?.node.remove();
    this.details = new Details(layout, { close: () => this.select(null) });
    this.table = new JointTable(layout, { select: (dof) => this.selectDof(dof), selected: () => this.chosen.dof });
    this.tableBox.replaceChildren(this.table.node);
    this.stage.node.append(this.details.node);
    this.stage.setLayout(layout);
    this.cards.setLayout(layout);
    if (!this.report && !same) this.view.follow();
    if (this.chosen.link !== null) this.details.show(this.chosen.link, this.chosen.dof);
    toggle(this.left, "detailed", this.chosen.link !== null);
    document.title = `${layout.json.robot} · diag_dynamics`;
    this.#want("plots", "numbers", "robot", "strip");
  }

  // The link of ellipsoid and arrow, as the source has it.
  marked(link) {
    this.stage.marked = link;
  }

  came() {
    if (this.view.following) this.#want("plots", "numbers", "robot");
    this.wanted.strip = true;
  }

  diagnosed(list) {
    this.health.told(list);
    this.cards.diagnosed(list);
    this.touch();
  }

  beat(json, drawn) {
    this.cards.beat(json, drawn);
    this.touch();
  }

  listed(robots, robot) {
    this.bar.listed(robots, robot);
  }

  // --- what people do ---

  // link of null: nothing.
  select(link) {
    const dof = link === null ? -1 : this.layout.dofOfLink(link);
    this.#select(link, dof);
  }

  selectDof(dof) {
    if (dof === this.chosen.dof) return this.select(null);
    return this.#select(this.layout.linkOfDof[dof] ?? this.layout.links[0], dof);
  }

  #select(link, dof) {
    this.chosen = { link, dof };
    this.details.show(link, dof);
    toggle(this.left, "detailed", link !== null);
    if (link !== null) this.source.follow?.(link);
    this.#want("plots", "numbers", "robot");
  }

  #actions() {
    const { view } = this;
    const colour = (k) => () => this.stage.colourBy(k);
    return [
      [[" "], this.report ? "play, stop" : "pause, go on", () => this.toggle()],
      [["ArrowLeft", "ArrowRight"], "a state back, forward (with shift: a second)", (event) => this.#stepBy(event)],
      [["Home"], "to the beginning", () => view.go(this.rows.first)],
      [["End", "l"], this.report ? "to the end" : "live", () => (this.report ? view.go(this.rows.last) : view.follow())],
      [["+", "-"], "shorter, longer window", (event) => view.zoom(view.length * (event.key === "+" ? 0.5 : 2))],
      [["0"], this.report ? "the whole recording" : "a window of 30 s", () => (this.report ? view.whole() : view.zoom(30))],
      [["1", "2", "3", "4"], "links by energy share, energy, torque, external torque", (event) => colour(Number(event.key) - 1)()],
      [["e"], "ellipsoid and velocity", () => this.stage.toggleMarks()],
      [["f"], "whole robot in view", () => this.stage.frame()],
      [["j", "k"], "next, previous joint", (event) => this.#nextJoint(event.key === "j" ? 1 : -1)],
      [["r"], "next robot", () => this.bar.nextRobot()],
      [["t"], "light, dark", () => this.theme.next()],
      [["c"], "numbers of the time window (CSV)", () => this.csv()],
      [["Escape"], "nothing chosen", () => this.layout && this.select(null)],
      [["?"], "this", () => this.keys.help()],
    ];
  }

  toggle() {
    if (this.report) this.source.play();
    else if (this.view.paused) this.view.follow();
    else this.view.pause();
  }

  #stepBy(event) {
    const forward = event.key === "ArrowRight" ? 1 : -1;
    if (event.shiftKey) this.view.go(this.view.now() + forward);
    else this.view.step(forward);
  }

  #nextJoint(by) {
    if (!this.layout) return;
    const count = this.layout.dofs.length;
    const dof = this.chosen.dof < 0 ? (by > 0 ? 0 : count - 1) : (this.chosen.dof + by + count) % count;
    this.#select(this.layout.linkOfDof[dof], dof);
  }

  csv() {
    if (!this.layout) return;
    const robot = this.layout.json.robot.replace(/[^\w.-]+/g, "_");
    const time = new Date().toISOString().slice(0, 19).replace(/:/g, "-");
    download(`${robot}_${time}.csv`, csv(this.layout, this.rows, this.view.window()));
  }

  // --- drawing ---

  #want(...what) {
    for (const one of what) this.wanted[one] = true;
  }

  #moved(what) {
    this.rows.held = this.view.paused && !this.report;
    if (what === "window") this.#want("plots", "strip");
    if (what === "pointer") this.wanted.place = true;
    else this.#want("numbers", "robot", "place");
    if (what !== "pointer") this.wanted.now = true; // somebody waits for it
  }

  // What changes by itself as time goes by, as the age of a state.
  touch() {
    this.bar.draw();
    this.stage.judged(this.verdict());
  }

  verdict() {
    return this.health.judge(this.flags(), { paused: this.view.paused, report: this.report, rate: this.health.heart?.rate });
  }

  flags() {
    const at = this.layout?.at("flags");
    const { rows } = this;
    if (!rows.length || !Number.isFinite(at)) return 0;
    const value = rows.data[rows.base(rows.nearest(this.view.now())) + at];
    return Number.isFinite(value) ? value : 0;
  }

  #draw(now) {
    const { due, wanted, rows } = this;
    if (!this.layout || !rows.length) {
      this.stage.render();
      return;
    }
    const begun = performance.now();
    const turn = (what, every) => {
      if (!wanted[what] || (now < due[what] && !wanted.now)) return false;
      wanted[what] = false;
      due[what] = now + every;
      return true;
    };
    const i = rows.nearest(this.view.now());
    if (turn("plots", PLOTS)) this.cards.draw();
    else if (wanted.place) this.cards.place();
    if (turn("numbers", NUMBERS)) {
      this.table.draw(rows, i);
      this.details.draw(rows, i);
      this.cards.contact?.draw(rows.data, rows.base(i));
      this.stage.touched(this.cards.contact?.worst ?? null);
      this.touch();
    }
    if (turn("strip", STRIP)) this.timeline.draw();
    else this.timeline.place();
    const posed = turn("robot", ROBOT);
    if (posed) this.stage.draw(rows, i);
    if (wanted.now) this.cost.step = performance.now() - begun;
    wanted.place = wanted.now = false;
    this.stage.render();
  }
}

const NOTHING = { length: 0, first: NaN, last: NaN, held: false, bytes: 0 };
