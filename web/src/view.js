// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The time window of all plots, and the moment at which numbers and robot are shown.

import { clock, decimalsOf } from "./format.js";

const SHORTEST = 0.02; // [s] of a window

export class View {
  // rows: () => Rows; live: whether the window follows the newest state; changed(what): "window", "moment" or "pointer"
  constructor(rows, live, changed) {
    this.rows = rows;
    this.live = live;
    this.changed = changed;
    this.length = live ? 30 : 0; // [s]
    this.usual = 30; // length that needs no mention; of a report, all
    this.paused = !live;
    this.end = NaN; // of the window, while paused
    this.moment = NaN; // while paused
    this.pointing = null; // the time under the pointer
  }

  get following() {
    return this.live && !this.paused;
  }

  window() {
    const end = this.following ? this.rows().last : this.end;
    return [end - this.length, end];
  }

  // The moment of robot and table: the newest, or the one that was chosen.
  now() {
    return this.following ? this.rows().last : this.moment;
  }

  // The moment of the plots' cursor and legends: where the pointer is, else now.
  shown() {
    return this.pointing ?? this.now();
  }

  point(t) {
    this.pointing = t === null ? null : this.#inside(t);
    this.changed("pointer");
  }

  pause() {
    if (this.paused) return;
    [this.end, this.moment] = [this.rows().last, this.rows().last];
    this.paused = true;
    this.changed("window");
  }

  follow() {
    if (!this.live) return;
    this.paused = false;
    this.pointing = null;
    this.changed("window");
  }

  // Shows a moment; the window moves if the moment is outside.
  go(t) {
    if (!this.rows().length) return;
    this.pause();
    this.moment = this.#inside(t);
    const [t0, t1] = this.window();
    if (this.moment < t0 || this.moment > t1) {
      this.end = this.#bounded(this.moment + 0.5 * this.length);
      this.changed("window");
    } else this.changed("moment");
  }

  // Steps by a number of states.
  step(count) {
    const rows = this.rows();
    if (!rows.length) return;
    this.pause();
    const i = rows.nearest(this.moment) + count;
    this.go(rows.time(Math.min(rows.length - 1, Math.max(0, i))));
  }

  // Sets the length of the window, about a time.
  zoom(length, about = null) {
    const rows = this.rows();
    const longest = this.live ? 3600 : Math.max(SHORTEST, rows.last - rows.first);
    const before = this.length;
    const next = Math.min(longest, Math.max(SHORTEST, length));
    if (!this.following && before > 0) {
      const centre = about ?? this.moment;
      const part = (this.end - centre) / before;
      this.end = centre + part * next;
    }
    this.length = next;
    if (!this.following) this.end = this.#bounded(this.end);
    this.changed("window");
  }

  // Shows exactly that window.
  see(t0, t1) {
    this.pause();
    this.length = Math.max(SHORTEST, t1 - t0);
    this.end = this.#bounded(t1);
    this.changed("window");
  }

  whole() {
    const rows = this.rows();
    this.length = this.usual = Math.max(SHORTEST, rows.last - rows.first);
    this.end = rows.last;
    if (!Number.isFinite(this.moment)) this.moment = rows.first;
    this.changed("window");
  }

  #inside(t) {
    const rows = this.rows();
    return Math.min(rows.last, Math.max(rows.first, t));
  }

  #bounded(end) {
    const rows = this.rows();
    return Math.min(rows.last, Math.max(end, Math.min(rows.last, rows.first + this.length)));
  }

  // Origin of the axes: the beginning of a report, now for a live page.
  base() {
    return this.live ? this.window()[1] : this.rows().first;
  }

  splits(base, low, high, step) {
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
    return found;
  }

  // The first label alone has the unit.
  labels(base, splits) {
    const step = splits.length > 1 ? splits[1] - splits[0] : 1;
    const decimals = decimalsOf(step);
    const label = (x) => (Math.abs(x) < 1e-9 ? "0" : x.toFixed(decimals).replace("-", "−"));
    return splits.map((x, k) => (this.following && Math.abs(x) < 1e-9 ? "now" : label(x) + (k ? "" : " s")));
  }

  label(t) {
    const rows = this.rows();
    if (!rows.length || !Number.isFinite(t)) return "–";
    return this.live ? clock(t) : `${(t - rows.first).toFixed(3)} s`;
  }
}
