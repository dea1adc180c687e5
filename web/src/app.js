// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The page: its parts, their events, and when each part is drawn.

import { Bar } from "./bar.js";
import { Cards } from "./cards.js";
import { HOLD_OFF } from "./collisions.js";
import { Theme } from "./colours.js";
import { Details } from "./details.js";
import { readOnly } from "./diag.js";
import { download, el, toggle } from "./dom.js";
import { Health } from "./health.js";
import { JointTable } from "./joints.js";
import { Keys } from "./keys.js";
import { csv } from "./layout.js";
import { fromHash, toHash } from "./link.js";
import { DEFAULT } from "./presets.js";
import { COLOURINGS } from "./quantities.js";
import { Stage } from "./stage.js";
import { Timeline } from "./timeline.js";
import { View } from "./view.js";

const PERIODS = { plots: 90, numbers: 120, robot: 33, strip: 1000 }; // [ms] between two drawings
const NOTICE = 4000; // [ms] that a notice about a copied link stays
const PARTS = Object.keys(PERIODS);
const AROUND = 2; // [s] that a report shows before and after a collision
const NO_ROWS = { length: 0, first: NaN, last: NaN, held: false, bytes: 0 };

export class App {
  constructor(body, { report, errors }) {
    this.report = report;
    this.health = new Health();
    this.layout = null;
    this.chosen = { link: null, dof: -1 };
    this.wanted = null; // state of a link that is not yet restored
    this.notice = ""; // about the link
    this.due = Object.fromEntries(PARTS.map((part) => [part, 0]));
    this.dirty = new Set(PARTS);
    this.view = new View(() => this.rows, !report, (what) => this.#moved(what));
    this.theme = new Theme(() => this.stage && this.#restyle());
    const shared = {
      theme: this.theme,
      view: this.view,
      rows: () => this.rows,
      layout: () => this.layout,
      selected: () => this.chosen.dof,
      selectLink: (link) => this.select(link),
      collisions: () => this.source?.collisions ?? [],
      events: () => this.cards.collisions.events,
      show: (event) => this.#showEvent(event),
      point: (plot) => this.cards.point(plot),
    };
    this.stage = new Stage({ ...shared, app: this });
    this.cards = new Cards(shared);
    this.timeline = new Timeline(shared);
    this.keys = new Keys(this.#actions());
    this.bar = new Bar(this);
    this.tableBox = el("div", { class: "tablebox" });
    this.left = el("div", { class: "left" }, this.stage.node, this.tableBox);
    const foot = el("footer", {}, this.bar.transport, this.timeline.node);
    body.append(this.bar.node, el("main", {}, this.left, this.cards.node), foot, this.keys.dialog, this.cards.menu);
    toggle(body, "report", report);
    this.stage.restyle();
    readOnly(this, errors);
    this.#open();
    addEventListener("hashchange", () => this.#open());
    addEventListener("resize", () => this.#mark("plots", "strip"));
  }

  begin(source) {
    this.source = source;
    source.begin();
    const loop = (now) => {
      requestAnimationFrame(loop);
      this.#draw(now);
    };
    requestAnimationFrame(loop);
    setInterval(() => this.update(), 500);
  }

  get rows() {
    return this.source?.rows ?? NO_ROWS;
  }

  // --- events of the source ---

  // same: whether the robot is unchanged.
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
    this.#show();
    document.title = `${layout.json.robot} · diag_dynamics`;
    this.#mark(...PARTS);
  }

  // The link of ellipsoid and arrow.
  marked(link) {
    this.stage.marked = link;
  }

  came() {
    this.restore();
    if (this.view.following) this.#mark("plots", "numbers", "robot");
    this.#mark("strip");
  }

  diagnosed(list) {
    this.health.setDiagnostics(list);
    this.cards.diagnosed(list);
    this.update();
  }

  beat(json, shown) {
    this.cards.beat(json, shown);
    this.update();
  }

  listed(robots, robot) {
    this.bar.listed(robots, robot);
    this.stage.fleet?.update();
  }

  // --- the link ---

  // Begins to restore the state of the page's address; what needs a robot follows with its first state.
  #open() {
    const { state, notes } = fromHash(location.hash);
    this.notice = notes.map((note) => `link: ${note}`).join("; ");
    if (location.hash === this.hash || !location.hash) return;
    this.wanted = state;
    this.cards.show({ chosen: state.cards });
    if (state.colour && !this.stage.colourBy(state.colour)) this.#note(`colour is '${state.colour}'`);
    if (state.all) this.showAll(true);
    if (state.robot && this.source?.robots.some(({ name }) => name === state.robot)) this.source.choose(state.robot);
    if (!state.robot || state.robot === this.source?.robot) this.restore();
  }

  restore() {
    const { wanted, layout, rows, source, view } = this;
    if (!wanted || !layout || !rows.length || source.layout === null) return;
    this.wanted = null;
    const { robot, joint, camera, card = null, window, t } = wanted;
    this.cards.show({ large: card });
    if (robot && robot !== source.robot) return this.#note(`robot is '${robot}', which is not here`);
    const dof = layout.dofs.indexOf(joint);
    if (dof >= 0) this.#select(layout.linkOfDof[dof], dof);
    else if (layout.links.includes(joint)) this.select(joint);
    else if (joint) this.#note(`joint is '${joint}'; ${layout.json.robot} has none of this name`);
    if (camera && this.stage.scene?.setPose(camera) === false) this.#note(`camera is '${camera}'; expected a view or six numbers`);
    if (t >= rows.first && t <= rows.last) view.go(t);
    else if (t !== undefined) this.#note(`the states of ${view.label(t)} are not in this page`);
    if (window) view.zoom(window);
  }

  #note(text) {
    this.notice = [this.notice, `link: ${text}`].filter(Boolean).join("; ");
  }

  #state() {
    const { source, view, stage, cards, layout } = this;
    const { link, dof } = this.chosen;
    const pose = stage.scene?.pose;
    return {
      robot: source.robots.length > 1 ? source.robot : "",
      joint: dof >= 0 ? layout.dofs[dof] : link,
      t: view.paused ? view.now() : null,
      window: view.length === view.usual ? null : view.length,
      colour: stage.colouring === "share" ? null : stage.colouring,
      camera: pose === "iso" || stage.following ? null : pose,
      card: cards.large,
      cards: cards.choice === DEFAULT ? null : cards.choice,
      all: stage.fleet?.on,
    };
  }

  // Keeps the state in the page's address.
  #remember() {
    if (this.wanted || !this.layout || !this.rows.length || this.source.playing) return;
    const hash = toHash(this.#state());
    if (hash === this.hash) return;
    this.hash = hash;
    try {
      history.replaceState(null, "", hash || location.pathname + location.search);
    } catch {
      // a page inside another one may have no address
    }
  }

  // Copies the link; a page without https has no clipboard, but its address is the link.
  async copyLink() {
    this.#remember();
    const copied = navigator.clipboard?.writeText(location.href).then(() => "link copied");
    const said = (this.notice = (await copied?.catch(() => "")) || "the address of this page is the link");
    setTimeout(() => (this.notice = this.notice === said ? "" : this.notice), NOTICE);
    this.update();
  }

  // --- events of the user ---

  // link of null: none.
  select(link) {
    this.#select(link, link === null ? -1 : this.layout.dofOfLink(link));
  }

  selectDof(dof) {
    if (dof === this.chosen.dof) this.select(null);
    else this.#select(this.layout.linkOfDof[dof], dof);
  }

  #select(link, dof) {
    this.chosen = { link, dof };
    this.#show();
    if (link !== null) this.source.follow?.(link);
    this.#mark("plots", "numbers", "robot");
  }

  #show() {
    const { link, dof } = this.chosen;
    this.details.show(link, dof);
    if (this.stage.following) this.stage.follow(true);
    toggle(this.left, "detailed", link !== null);
  }

  #actions() {
    const { report, view } = this;
    return [
      [[" "], report ? "play or pause" : "pause or continue", () => this.toggle()],
      [["ArrowLeft", "ArrowRight"], "previous or next state (Shift: one second)", (event) => this.#step(event)],
      [["Home"], "start", () => view.go(this.rows.first)],
      [["End", "l"], report ? "end" : "live", () => (report ? view.go(this.rows.last) : view.follow())],
      [["b", "n"], "previous or next collision or contact", ({ key }) => this.cards.collisions.step(key === "n" ? 1 : -1)],
      [["+", "-"], "shorter or longer time window", (event) => view.zoom(view.length * (event.key === "+" ? 0.5 : 2))],
      [["0"], report ? "whole recording" : "time window of 30 s", () => (report ? view.whole() : view.zoom(30))],
      [["1", "2", "3", "4"], "colour links by energy share, link energy, joint torque, external torque", ({ key }) => this.stage.colourBy(Object.keys(COLOURINGS)[key - 1])],
      [["e"], "show or hide ellipsoid and velocity", () => this.stage.toggleMarks()],
      [["f", "F"], "fit the robot into the view (Shift: reset the view)", ({ key }) => (key === "f" ? this.stage.look() : this.stage.resetView())],
      [["v"], "next view: iso, front, side, top", () => this.stage.nextView()],
      [["g"], "follow the selected link, mobile base or end effector", () => this.stage.follow(!this.stage.following)],
      [["j", "k"], "select the next or previous joint", (event) => this.#nextJoint(event.key === "j" ? 1 : -1)],
      [["r"], "next robot", () => this.bar.nextRobot()],
      ...(this.report ? [] : [[["a"], "all robots in one scene", () => this.showAll(!this.stage.fleet?.on)]]),
      [["t"], "light or dark theme", () => this.theme.next()],
      ...(this.report ? [] : [[["p"], "push the simulated robot", () => this.source.push()]]),
      [["y"], "copy a link to this view", () => this.copyLink()],
      [["c"], "download the time window as CSV", () => this.csv()],
      [["Escape"], "back from a large card; clear the selection", () => (this.cards.large ? this.cards.show({ large: null }) : this.layout && this.select(null))],
      [["?"], "show this list", () => this.keys.help()],
    ];
  }

  showAll(on) {
    this.stage.fleet?.show(on);
    this.update();
  }

  toggle() {
    if (this.report) this.source.play();
    else if (this.view.paused) this.view.follow();
    else this.view.pause();
  }

  #step({ key, shiftKey }) {
    const step = key === "ArrowRight" ? 1 : -1;
    if (shiftKey) this.view.go(this.view.now() + step);
    else this.view.step(step);
  }

  #showEvent({ start, end, t }) {
    if (this.report) this.view.see(start - AROUND, end + AROUND);
    this.view.go(t);
  }

  #nextJoint(step) {
    const count = this.layout?.dofs.length;
    if (!count) return;
    const dof = this.chosen.dof < 0 && step < 0 ? count - 1 : (this.chosen.dof + step + count) % count;
    this.#select(this.layout.linkOfDof[dof], dof);
  }

  csv() {
    if (!this.layout) return;
    const robot = this.layout.json.robot.replace(/[^\w.-]+/g, "_");
    const time = new Date().toISOString().slice(0, 19).replace(/:/g, "-");
    download(`${robot}_${time}.csv`, csv(this.layout, this.rows, this.view.window()));
  }

  // --- drawing ---

  #mark(...parts) {
    for (const part of parts) this.dirty.add(part);
  }

  #restyle() {
    this.stage.restyle();
    this.cards.restyle();
    this.#mark(...PARTS);
  }

  #moved(what) {
    this.rows.held = this.view.paused && !this.report;
    if (what === "window") this.#mark("plots", "strip");
    if (what !== "pointer" && this.stage.fleet) this.stage.fleet.dirty = true;
    if (what !== "pointer") this.#mark("numbers", "robot", "now"); // at once: the user waits for it
    this.#mark("cursor");
  }

  // Updates values that change with time, such as the age of a state.
  update() {
    this.#remember();
    this.bar.draw();
    this.stage.showVerdict(this.verdict());
  }

  verdict() {
    const event = this.cards.collisions.at(this.view.now(), this.view.following ? HOLD_OFF : undefined);
    return this.health.judge(this.flags(), { paused: this.view.paused, report: this.report, rate: this.health.heart?.rate, event });
  }

  flags() {
    const { rows, layout } = this;
    if (!rows.length || !layout) return 0;
    return rows.data[rows.base(rows.nearest(this.view.now())) + layout.at("flags")] || 0;
  }

  #draw(now) {
    const { due, dirty, rows } = this;
    if (this.layout && rows.length) {
      const isDue = (part) => {
        if (!dirty.has(part) || (now < due[part] && !dirty.has("now"))) return false;
        dirty.delete(part);
        due[part] = now + PERIODS[part];
        return true;
      };
      const i = rows.nearest(this.view.now());
      if (isDue("plots")) this.cards.draw();
      else if (dirty.has("cursor")) this.cards.place();
      const [isNew, isStripDue] = [isDue("numbers"), isDue("strip")];
      if (isNew || isStripDue) {
        this.cards.collisions.draw();
        this.cards.nameEvents();
      }
      if (isNew) this.#drawNumbers(i);
      if (isStripDue) {
        this.timeline.draw();
      } else this.timeline.place();
      if (isDue("robot")) this.stage.draw(rows, i);
      for (const part of ["now", "cursor"]) dirty.delete(part);
    }
    if (!this.cards.large) this.stage.render();
  }

  #drawNumbers(i) {
    const { rows } = this;
    const { contact } = this.cards;
    this.table.draw(rows, i);
    this.details.draw(rows, i);
    contact?.draw(rows.data, rows.base(i));
    this.cards.collisions.place();
    this.stage.showContact(contact?.worst ?? null);
    this.update();
  }
}
