// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The robot, the legend of its colours, and numbers of the chosen link.

import { eventText, symmetric } from "./collisions.js";
import { COLOURINGS, K, linkValues, massAlong, noiseOf, placeOf, roundUp, valueAt } from "./quantities.js";
import { hex, ramp, rampGradient, store, stored } from "./colours.js";
import { el, say, toggle } from "./dom.js";
import { measure, quantity, shortened, withUnit } from "./format.js";
import { largestOf } from "./joints.js";
import { highEnd } from "./sampling.js";
import { Fleet } from "./fleet.js";
import { Scene3D, VIEWS } from "./scene3d.js";

const IDS = Object.keys(COLOURINGS);
const QUANTILE = 0.98; // of the links' largest values in the time window: the end of the colours
const REASON = 110; // letters of the reason why a mesh is missing
const SCALE_PERIOD = 1000; // [ms] between two choices of this end

export class Stage {
  constructor({ theme, app }) {
    this.theme = theme;
    this.app = app;
    this.colouring = IDS.includes(stored("diag.colouring")) ? stored("diag.colouring") : "share";
    this.marks = stored("diag.marks") !== "off";
    this.full = stored("diag.range") === "full"; // whether colours end at 100 %, or at the maximum
    this.following = false;
    this.marked = null;
    this.colours = new Map();
    this.choice = el("select", { title: "quantity that colours the links (1 to 4)", "aria-label": "colour of links", onchange: () => this.colourBy(this.choice.value) }, ...IDS.map((id) => el("option", { value: id, text: COLOURINGS[id].label })));
    this.range = el("select", { title: `end of the scale: ${100 * QUANTILE} % quantile of the time window, or all`, "aria-label": "range of colours", onchange: () => this.#setRange(this.range.selectedIndex === 1) }, el("option", { text: "recent values" }), el("option"));
    const button = (text, title, onclick) => el("button", { text, title, onclick });
    this.followButton = button("Follow", "keep the selected link in view, else a mobile base or the end effector (g)", () => this.follow(!this.following));
    const views = Object.keys(VIEWS).map((view) => button(view[0].toUpperCase() + view.slice(1), `view: ${view} (v: next)`, () => this.look(view)));
    this.camera = el("div", { class: "camera", role: "group", "aria-label": "camera" }, button("Fit", "fit the robot into the view (f)", () => this.look()), ...views, this.followButton);
    this.ticks = ["0", "", ""].map((text) => el("span", { text }));
    this.meaning = el("div", { class: "meaning" });
    const colours = el("div", { class: "colours" }, el("div", { class: "choices" }, this.choice, this.range), this.meaning, el("div", { class: "gradient", style: `background-image:${rampGradient()}` }), el("div", { class: "ticks" }, ...this.ticks));
    this.legend = el("div", { class: "ramp" }, colours, this.camera);
    this.energy = el("b");
    this.marksNote = el("div", { class: "marks" });
    this.forceNote = el("div", { class: "marks force" });
    this.missing = el("div", { class: "marks missing" });
    this.head = el("div", { class: "headline" }, el("div", {}, el("small", { text: "kinetic energy K" }), this.energy), this.marksNote, this.forceNote, this.missing);
    this.banner = el("div", { class: "banner", hidden: true }, (this.state = el("div")), (this.why = el("p")));
    this.hint = el("div", { class: "hint", hidden: true });
    this.node = el("div", { class: "stage" }, this.head, this.legend, this.banner, this.hint);
    try {
      this.scene = new Scene3D(this.node, { load: (sha) => app.source.mesh(sha), changed: () => this.#missing() });
      this.fleet = new Fleet(app, this.scene);
      this.#listen();
    } catch (error) {
      say(this.hint, `No 3D view: this browser does not provide WebGL (${error.message}).`);
      this.hint.hidden = false;
      this.hint.classList.add("fixed");
    }
  }

  #listen() {
    const { canvas } = this.scene;
    let [downX, downY, looked] = [0, 0, 0];
    canvas.addEventListener("pointerdown", (event) => ([downX, downY] = [event.offsetX, event.offsetY]));
    canvas.addEventListener("click", (event) => {
      if (Math.hypot(event.offsetX - downX, event.offsetY - downY) >= 5) return;
      const { link = null, robot } = this.scene.pick(event.offsetX, event.offsetY);
      if (robot?.name) this.app.source.choose(robot.name);
      else this.app.select(link);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons || performance.now() - looked < 80 || event.pointerType !== "mouse") return;
      looked = performance.now();
      const { link, robot } = this.scene.pick(event.offsetX, event.offsetY);
      canvas.style.cursor = link ? "pointer" : "";
      this.hint.hidden = !link;
      if (link) {
        say(this.hint, `${link}  ${robot.name || this.#value(link)}`);
        this.hint.style.transform = `translate(${Math.min(event.offsetX + 14, this.node.clientWidth - this.hint.offsetWidth - 6)}px, ${Math.max(4, event.offsetY - 30)}px)`;
      }
    });
    canvas.addEventListener("pointerleave", () => (this.hint.hidden = true));
  }

  #value(link) {
    const value = this.values?.get(link);
    return Number.isFinite(value) ? `${measure(value, this.end)} ${COLOURINGS[this.colouring].unit(this.layout)}` : "";
  }

  // Shows how many meshes are missing, and why.
  #missing() {
    const reasons = [...new Set([...Object.values(this.layout?.scene.missing ?? {}), ...(this.scene?.robot?.failures ?? [])])];
    const count = Object.keys(this.layout?.scene.missing ?? {}).length + (this.scene?.robot?.failures.length ?? 0);
    say(this.missing, count ? `${count === 1 ? "1 mesh is" : `${count} meshes are`} missing: ${shortened(reasons[0], REASON)}` : "");
    this.missing.title = reasons.join("\n");
  }

  setLayout(layout) {
    this.layout = layout;
    this.noise = noiseOf(layout);
    this.marked = layout.json.end_effector; // a report has mobility and velocity of this link only
    this.scene?.setLayout(layout);
    this.fleet?.update();
    this.follow(this.following);
    this.#getters();
    this.#missing();
  }

  // id: of COLOURINGS. Returns whether there is such a one.
  colourBy(id) {
    if (!IDS.includes(id)) return false;
    this.colouring = id;
    store("diag.colouring", id);
    this.#getters();
    this.again();
    return true;
  }

  toggleMarks() {
    this.marks = !this.marks;
    store("diag.marks", this.marks ? "on" : "off");
    this.again();
  }

  // Fits the robot into a view of VIEWS, or into the present one.
  look(view) {
    this.scene?.fit(view);
  }

  nextView() {
    const views = Object.keys(VIEWS);
    this.look(views[(views.indexOf(this.scene?.pose) + 1) % views.length]);
  }

  resetView() {
    this.follow(false);
    this.look("iso");
  }

  // Follows the selected link; where there is none, a mobile base or the end effector.
  follow(on) {
    this.following = on;
    this.followButton.setAttribute("aria-pressed", on);
    const { layout } = this;
    this.scene?.follow(on && layout ? (this.app.chosen.link ?? layout.mobileBase ?? layout.json.end_effector) : null);
  }

  #setRange(full) {
    this.full = full;
    store("diag.range", full ? "full" : "quantile");
    this.again();
  }

  again() {
    if (this.last) this.draw(...this.last);
  }

  #getters() {
    if (!this.layout) return;
    this.choice.selectedIndex = IDS.indexOf(this.colouring);
    this.range.options[1].text = COLOURINGS[this.colouring].full(this.layout) ? "0–100 %" : "0–maximum";
    this.range.selectedIndex = Number(this.full);
    const { meaning, unit } = COLOURINGS[this.colouring];
    say(this.meaning, `Colour: ${meaning}, ${unit(this.layout)}`);
    this.valuesAt = linkValues(this.layout, this.colouring);
    if (this.fleet) this.fleet.dirty = true;
  }

  restyle() {
    this.scene?.setTheme(this.theme);
  }

  draw(rows, i) {
    this.last = [rows, i];
    const { data } = rows;
    const base = rows.base(i);
    this.time = rows.time(i);
    say(this.energy, `${measure(K(this.layout)(data, base), this.noise.J)} J`);
    this.#paint(data, base);
    this.scene?.place(data, base);
    this.#mark(data, base);
    this.#force(data, base);
  }

  // The force of the collision or contact.
  #force(data, base) {
    const event = this.app.cards.collisions.at(this.time);
    this.scene?.showForce(event?.touch ?? null);
    say(this.forceNote, event ? eventText(event) : "");
    this.forceNote.title = "68 % interval of the force, over all links and points. Arrow: the force at the centre of mass of the most probable link, if all its directions are observed.";
  }

  #paint(data, base) {
    const colouring = COLOURINGS[this.colouring];
    this.values = this.valuesAt(data, base);
    const end = (this.end = this.#scale(colouring));
    const isWhole = this.full || end >= (colouring.full(this.layout) ?? Infinity);
    [0, 0.5, 1].forEach((place, k) => say(this.ticks[k], `${place < 1 || isWhole ? "" : "≥ "}${Number(valueAt(colouring, place, end).toPrecision(3))}`));
    if (this.scene) this.paint(this.scene.robot, this.values);
  }

  // Colours the links of a robot by their values.
  paint(robot, values) {
    for (const { name } of robot.layout.scene.links) {
      const rgb = ramp(placeOf(COLOURINGS[this.colouring], values.get(name), this.end));
      const isOwn = robot === this.scene.robot;
      if (isOwn) this.colours.set(name, hex(rgb));
      if (robot.paint(name, rgb, isOwn && name === this.app.chosen.link)) this.scene.dirty = true;
    }
  }

  // The end of the colours.
  #scale(colouring) {
    const full = colouring.full(this.layout);
    if (this.full && full) return full;
    const { rows, view } = this.app;
    const [now, window] = [performance.now(), view.window()];
    const key = [this.colouring, this.full, this.layout.json.robot, ...(view.following ? [] : window)].join();
    if (key === this.scaleKey && now < this.scaleDue) return this.end;
    [this.scaleKey, this.scaleDue] = [key, now + SCALE_PERIOD];
    const end = highEnd(rows, ...rows.range(...window), (d, b) => largestOf([...this.valuesAt(d, b).values()]), this.full ? 1 : QUANTILE);
    return roundUp(Math.max(end || 0, full ? 0.05 * full : 1e-6));
  }

  #mark(data, base) {
    const { layout } = this;
    const [a, v] = [layout.at("mobility_root"), layout.at("link_velocity")];
    const known = this.marks && Number.isFinite(a) && Number.isFinite(data[base + a]);
    if (!known) {
      this.scene?.mark(null, null);
      say(this.marksNote, "");
      this.shown = null;
      return;
    }
    const root = symmetric(data.subarray(base + a, base + a + 6));
    const velocity = [...data.subarray(base + v, base + v + 3)];
    const speed = Math.hypot(...velocity);
    const mass = massAlong(root, velocity);
    // With 1 J of kinetic energy a link can be as fast as √(2λ) along an axis.
    this.scene?.mark(this.marked, root.map((row) => row.map((x) => Math.SQRT2 * x)), Number.isFinite(speed) ? velocity : [0, 0, 0]);
    this.shown = { link: this.marked, speed, mass };
    const reflected = Number.isFinite(mass) ? `, reflected mass ${quantity(mass, "kg")}` : "";
    say(this.marksNote, `${this.marked}: ${withUnit(measure(speed, this.noise["m/s"]), "m/s")}${reflected}`);
    this.marksNote.title = "Ellipsoid: velocities that 1 J of kinetic energy allows (J M⁻¹ Jᵀ). Arrow: velocity of the link. Reflected mass: along this velocity.";
  }

  showVerdict({ level, word, says, dim, worst }) {
    toggle(this.node, "dim", Boolean(dim));
    this.banner.hidden = !dim;
    this.banner.className = `banner ${level}`;
    if (!dim) return;
    say(this.state, says ? `${word}: ${says}` : word);
    say(this.why, worst && !says.includes(worst.text) ? worst.text : "");
  }

  // worst: the contact point with the smallest margin, {position, above}; null hides it.
  showContact(worst) {
    this.scene?.showContact(worst);
  }

  render() {
    this.fleet?.draw(this.app.view, this.colouring, (robot, values) => this.paint(robot, values));
    this.scene?.render();
  }
}
