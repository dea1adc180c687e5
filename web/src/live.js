// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The source of what is live: robots, their streams, meshes.

import { Layout } from "./layout.js";
import { Rows } from "./rows.js";
import { Stream } from "./stream.js";
import { stored, store } from "./colours.js";

const RATE = 50; // [Hz] that is asked for
const KEPT = 300; // [s] that can be scrubbed back
const MOST = 96e6; // bytes that states take
const AGAIN = 3000; // [ms] between two looks at which robots there are

export class Live {
  constructor(app) {
    this.app = app;
    this.rows = new Rows(1, 2);
    this.layout = null;
    this.robots = [];
    this.diagnostics = [];
    this.frames = 0;
    const { health } = app;
    this.stream = new Stream({
      layout: (json) => this.#layout(json),
      frame: (t, values) => this.#frame(t, values),
      diagnostics: (json) => {
        this.diagnostics = json;
        app.diagnosed(json);
      },
      heartbeat: (json) => {
        health.connection = "open";
        const now = performance.now();
        const drawn = (1000 * (this.frames - (this.counted?.frames ?? this.frames))) / (now - (this.counted?.at ?? now) || 1);
        this.counted = { frames: this.frames, at: now };
        health.heart = { ...json, at: now };
        app.beat(json, drawn);
      },
      contact: (json) => app.touched(json),
      connection: (state, seconds, why) => {
        Object.assign(health, { connection: state, retry: seconds, why, heart: null });
        app.touch();
      },
      unknown: () => this.#list(),
    });
  }

  begin() {
    this.#list();
    setInterval(() => document.visibilityState === "visible" && this.#list(), AGAIN);
  }

  async #list() {
    try {
      const answer = await fetch("robots", { cache: "no-store" });
      if (!answer.ok) return;
      this.robots = await answer.json();
    } catch {
      return; // the stream says what is wrong
    }
    this.app.health.robots = this.robots;
    const names = this.robots.map((robot) => robot.name);
    const wished = new URLSearchParams(location.search).get("robot") ?? stored("diag.robot");
    if ((this.robot === undefined || !names.includes(this.robot)) && names.length) {
      this.choose(names.includes(wished) ? wished : (this.robots.find((robot) => robot.alive)?.name ?? names[0] ?? ""));
    }
    this.app.listed(this.robots, this.robot);
  }

  async choose(robot) {
    if (robot === this.robot) return;
    this.robot = robot;
    store("diag.robot", robot);
    this.link = this.layout = this.text = null;
    this.app.health.arrived = -Infinity;
    this.app.diagnosed([]);
    this.app.touched(null);
    this.app.listed(this.robots, robot);
    const link = await this.#endEffector(robot);
    if (robot === this.robot) this.stream.open(robot, (this.link = link), RATE);
  }

  // Name of the end-effector link; null before the server has a layout of the robot.
  async #endEffector(robot) {
    try {
      const answer = await fetch(`layout?${new URLSearchParams({ robot })}`);
      return answer.ok ? new Layout(await answer.json()).endEffector : null;
    } catch {
      return null; // the stream says what is wrong
    }
  }

  // The link of ellipsoid and arrow.
  follow(link) {
    if (link === this.link || !link || !this.layout?.links.includes(link)) return;
    this.link = link;
    this.app.marked(link);
    this.stream.open(this.robot, link, RATE);
  }

  #layout(json) {
    this.app.health.connection = "open";
    const text = JSON.stringify(json);
    if (text !== this.text) {
      const same = this.text && this.#shape(json) === this.#shape(this.layout.json);
      this.text = text;
      this.layout = new Layout(json);
      // The same robot as before, with its meshes now, or after a restart: what is stored stays.
      if (!same) this.rows = new Rows(this.layout.width, Math.min(KEPT * RATE, Math.floor(MOST / (4 * this.layout.width))));
      this.app.laidOut(this.layout, same);
    }
    if (this.layout.links.includes(this.link)) this.app.marked(this.link);
    else this.follow(this.layout.endEffector);
  }

  #shape({ robot, dofs, links, fields }) {
    return JSON.stringify([robot, dofs, links, fields]);
  }

  #frame(t, values) {
    if (!this.layout || values.length !== this.layout.width) return;
    this.frames++;
    this.app.health.arrived = performance.now();
    this.app.health.connection = "open";
    if (this.rows.push(t, values)) this.app.came();
  }

  mesh(sha) {
    return fetch(`mesh/${sha}`).then((answer) => {
      if (!answer.ok) throw new Error(`mesh ${sha}: ${answer.status}`);
      return answer.arrayBuffer();
    });
  }
}
