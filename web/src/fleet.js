// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// All robots in one scene: each one beside the chosen robot has a stream of its own, at a low rate.

import { CSS2DObject } from "three/examples/jsm/renderers/CSS2DRenderer.js";
import { el, say, toggle } from "./dom.js";
import { Layout } from "./layout.js";
import { linkValues } from "./quantities.js";
import { Robot } from "./robot.js";
import { Rows } from "./rows.js";
import { Stream } from "./stream.js";

const RATE = 15; // [Hz] of each stream
const HISTORY = 300; // [s]
const OLD = 1; // [s] from the moment shown, or since reception, above which a state is grey
const GAP = 1.3; // times the size of a robot, from its place to the next

class Other {
  constructor(name, fleet) {
    Object.assign(this, { name, rows: new Rows(1, 2), arrived: -Infinity, why: "" });
    this.stream = new Stream({
      layout: (json) => this.#setLayout(new Layout(json), fleet),
      frame: (t, values) => {
        if (values.length !== this.layout?.width || !this.rows.push(t, values)) return;
        [this.arrived, this.why, fleet.dirty] = [performance.now(), "", true];
      },
      lost: (why) => ([this.why, fleet.dirty] = [why, true]),
    });
    this.stream.open(name, "", RATE);
  }

  #setLayout(layout, fleet) {
    this.remove(fleet.scene);
    Object.assign(this, { layout, rows: new Rows(layout.width, HISTORY * RATE), colouring: null });
    this.robot = new Robot(layout, fleet.load, () => (fleet.scene.dirty = true));
    this.robot.name = this.name;
    fleet.scene.others.add(this.robot);
    fleet.arrange();
  }

  remove(scene) {
    if (!this.robot) return;
    scene.others.remove(this.robot);
    this.robot.dispose();
    this.robot = null;
  }

  // paint(robot, values, known): as the chosen robot is painted.
  draw(view, colouring, paint) {
    const { rows, layout } = this;
    if (!rows.length) return;
    const i = view.following ? rows.length - 1 : rows.nearest(view.now());
    const base = rows.base(i);
    const age = view.following ? (performance.now() - this.arrived) / 1000 : Math.abs(rows.time(i) - view.now());
    const placements = layout.placements(rows.data, base);
    if (placements) this.robot.place(placements);
    if (colouring !== this.colouring) [this.colouring, this.values] = [colouring, linkValues(layout, colouring)];
    this.t = rows.time(i);
    this.old = age > OLD;
    paint(this.robot, this.old ? new Map() : this.values(rows.data, base));
  }
}

export class Fleet {
  constructor(app, scene) {
    Object.assign(this, { app, scene, on: false, others: new Map(), names: [], key: "", dirty: false });
    this.load = (sha) => app.source.mesh(sha);
  }

  // on: whether all robots are shown.
  show(on) {
    this.on = on;
    this.update();
    this.scene.fit();
  }

  // Opens and closes streams: all robots but the chosen one have one.
  update() {
    const { robots = [], robot } = this.app.source ?? {};
    this.names = this.on ? robots.map(({ name }) => name) : [];
    for (const [name, other] of this.others) {
      if (this.names.includes(name) && name !== robot) continue;
      other.stream.close();
      other.remove(this.scene);
      this.others.delete(name);
    }
    for (const name of this.names) if (name !== robot && !this.others.has(name)) this.others.set(name, new Other(name, this));
    const key = this.on ? [...this.names, robot].join() : "";
    if (key !== this.key || (this.on && !this.scene.robot?.label)) this.arrange();
    this.key = key;
  }

  // Robots on a fixed base stand side by side, in the order of the list; a base that moves is where its odometry has it.
  arrange() {
    let edge = 0;
    for (const name of this.names) {
      const other = this.others.get(name);
      const robot = other ? other.robot : this.scene.robot;
      if (!robot) continue;
      const half = robot.layout.mobileBase ? 0 : GAP * robot.size;
      robot.position.set(0, half && edge + half, 0);
      edge += 2 * half;
      if (!robot.label) robot.add((robot.label = new CSS2DObject(el("button", { class: "tag", title: "show this robot", onclick: () => this.app.source.choose(name) }))));
    }
    if (!this.on) this.scene.robot?.alone();
    this.scene.rearranged();
    this.dirty = true;
  }

  draw(view, colouring, paint) {
    if (!this.dirty || !this.on) return;
    this.dirty = false;
    for (const other of this.others.values()) if (other.robot) other.draw(view, colouring, paint);
    for (const name of this.names) {
      const other = this.others.get(name);
      const label = (other ?? this.scene).robot?.label?.element;
      if (!label) continue;
      say(label, `${name}${other?.why ? ` (${other.why})` : ""}`);
      toggle(label, "old", Boolean(other?.old || other?.why));
      toggle(label, "chosen", !other);
    }
    this.scene.dirty = true;
  }
}
