// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The source of a report: the recording and the results that this file contains.

import { Layout } from "./layout.js";
import { Rows } from "./rows.js";
import { chapters, collisionNotes } from "./chapters.js";
import { bytesOf, rowsOf } from "./tracks.js";

export class Report {
  constructor(app, block) {
    this.app = app;
    this.content = JSON.parse(block.textContent);
    this.rows = new Rows(1, 2);
    this.playing = false;
    this.speed = 1;
    this.robots = [];
    this.robot = null;
    const { begin, summary } = this.content;
    const events = (kind, all) => (all ?? []).map((one) => ({ ...one, kind, start: one.start - begin, end: one.end - begin }));
    this.collisions = [...events("collision", summary.collisions), ...events("contact", summary.contacts)];
  }

  async begin() {
    const { app, content } = this;
    const layout = new Layout({ ...content.layout, report: true });
    this.rows = await rowsOf(layout, content.states);
    app.cards.chapters = chapters(content, { go: (t) => app.view.go(t) });
    app.cards.collisions.setNotes(...collisionNotes(content));
    app.laidOut(layout);
    app.view.end = this.rows.last;
    app.view.moment = this.rows.first;
    app.view.whole();
    const at = content.summary.kinetic_energy.at;
    if (at !== null) app.view.go(at - content.begin);
    app.restore();
    app.update();
  }

  mesh(sha) {
    const place = this.content.meshes[sha];
    if (place === undefined) return Promise.reject(new Error(`mesh ${sha} is not in this file`));
    return bytesOf(place).then((bytes) => bytes.buffer);
  }

  // Plays from the moment shown in real time; at the end, from the start.
  play() {
    const { view } = this.app;
    this.playing = !this.playing;
    this.app.update();
    if (!this.playing) return;
    if (view.now() >= this.rows.last - 1e-3) view.go(this.rows.first);
    let before = performance.now();
    const on = (now) => {
      if (!this.playing) return;
      const t = view.now() + ((now - before) / 1000) * this.speed;
      before = now;
      view.go(t);
      if (t >= this.rows.last) {
        this.playing = false;
        this.app.update();
      } else requestAnimationFrame(on);
    };
    requestAnimationFrame(on);
  }
}
