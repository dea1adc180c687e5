// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The source of a live page: robots, their stream, meshes.

import { Layout } from "./layout.js";
import { Rows } from "./rows.js";
import { Stream } from "./stream.js";
import { HOLD_OFF } from "./collisions.js";
import { stored, store } from "./colours.js";

const RATE = 50; // [Hz] requested
const HISTORY = 300; // [s]
const MAX_BYTES = 96e6; // of the history
const LIST_PERIOD = 3000; // [ms]

export class Live {
  constructor(app) {
    this.app = app;
    this.rows = new Rows(1, 2);
    this.layout = null;
    this.robots = [];
    this.collisions = []; // that diagnostics report
    this.frames = 0;
    this.counted = { frames: 0, now: 0 };
    const { health } = app;
    this.stream = new Stream({
      layout: (json) => this.#layout(json),
      frame: (t, values) => this.#frame(t, values),
      diagnostics: (json) => {
        app.diagnosed(json);
        this.#report(app.health.collision);
      },
      heartbeat: (json) => this.#beat(json),
      lost: (why, status) => {
        Object.assign(health, { connection: "lost", why, heart: null, error: status === 500 ? why : "" });
        app.update();
        if (status === 404) this.#list();
      },
    });
  }

  begin() {
    this.#list();
    setInterval(() => document.visibilityState === "visible" && this.#list(), LIST_PERIOD);
  }

  async #list() {
    try {
      this.robots = await (await fetch("robots", { cache: "no-store" })).json();
    } catch {
      return; // the stream reports the cause
    }
    this.app.health.robots = this.robots;
    const names = this.robots.map((robot) => robot.name);
    const preferred = this.app.wanted?.robot ?? new URLSearchParams(location.search).get("robot") ?? stored("diag.robot");
    if (!names.includes(this.robot) && names.length) {
      const alive = this.robots.find((robot) => robot.alive)?.name ?? names[0];
      this.choose(names.includes(preferred) ? preferred : alive);
    }
    this.app.listed(this.robots, this.robot);
  }

  choose(robot) {
    if (robot === this.robot) return;
    this.robot = robot;
    store("diag.robot", robot);
    this.link = this.layout = this.text = null;
    this.app.health.arrived = -Infinity;
    this.app.diagnosed([]);
    this.app.listed(this.robots, robot);
    this.stream.open(robot, "", RATE);
  }

  // Chooses the link of ellipsoid and arrow.
  follow(link) {
    if (link !== this.link && this.layout) this.stream.open(this.robot, link, RATE);
  }

  #layout(json) {
    const text = JSON.stringify(json);
    if (text === this.text) return;
    const shape = ({ robot, dofs, links, fields }) => JSON.stringify([robot, dofs, links, fields]);
    const same = this.text && shape(json) === shape(this.layout.json);
    this.text = text;
    this.layout = new Layout(json);
    const room = Math.min(HISTORY * RATE, Math.floor(MAX_BYTES / (4 * this.layout.width)));
    if (!same) [this.rows, this.collisions] = [new Rows(this.layout.width, room), []];
    this.app.laidOut(this.layout, same);
  }

  // Stores a collision that diagnostics report: it may be too short for the states of the page.
  #report(text) {
    const { last } = this.rows;
    if (!text || !Number.isFinite(last)) return;
    const before = this.collisions.at(-1);
    if (before && last - before.end <= HOLD_OFF) Object.assign(before, { end: last, text });
    else this.collisions.push({ kind: "collision", start: last, end: last, text, isReported: true });
  }

  #beat(json) {
    const { app, counted } = this;
    const now = performance.now();
    Object.assign(app.health, { connection: "open", heart: { ...json, at: now } });
    app.marked((this.link = json.link));
    if (now - counted.now > 900) {
      this.shown = (1000 * (this.frames - counted.frames)) / (now - counted.now);
      this.counted = { frames: this.frames, now };
    }
    app.beat(json, this.shown);
  }

  #frame(t, values) {
    if (values.length !== this.layout?.width) return;
    this.frames++;
    Object.assign(this.app.health, { connection: "open", arrived: performance.now() });
    if (this.rows.push(t, values)) this.app.came();
  }

  // Pushes the link of ellipsoid and arrow; the demo alone has a robot to push.
  push() {
    if (this.app.health.heart?.pushes) this.stream.send("push");
  }

  async mesh(sha) {
    const answer = await fetch(`mesh/${sha}`);
    if (!answer.ok) throw new Error(`mesh ${sha}: ${answer.status}`);
    return answer.arrayBuffer();
  }
}
