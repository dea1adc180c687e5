// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// What a touch would have cost at the states of a report, as page/contact.py has kept it.

import { FLAGS } from "./layout.js";

const HEAD = 4; // the worst point, and where it is

export class Kept {
  // points: {name, link, limited, directed}; rows: numbers of them, at the same states as those of the robot
  constructor({ points, half, leftOut }, rows, states, layout) {
    Object.assign(this, { points, half, leftOut, rows, states });
    this.flags = layout.at("flags");
    this.places = []; // of each point's allowed speed; null without a limit
    let next = HEAD + 2 * points.length;
    for (const { limited } of points) this.places.push(limited ? next++ : null);
  }

  get bytes() {
    return this.rows.bytes;
  }

  // Of the state nearest to a moment, as a server would tell it; of positions, that of the worst point.
  at(t) {
    const { rows, states } = this;
    const i = rows.nearest(t);
    const d = rows.data.subarray(rows.base(i), rows.base(i) + rows.width);
    const place = [...d.subarray(1, HEAD)];
    return {
      t: rows.time(i),
      half: this.half,
      worst: d[0],
      estimated: (states.data[states.base(i) + this.flags] & FLAGS.estimated) !== 0,
      points: this.points.map((point, k) => this.#point(d, point, k, k === d[0] ? place : null)),
    };
  }

  #point(d, { name, link, directed }, k, position) {
    const speed = d[HEAD + k];
    const logarithm = d[HEAD + this.points.length + k];
    const mass = known(10 ** logarithm) ?? (directed ? null : 0); // a point at rest has no direction, and no mass along it
    const allowed = this.places[k] === null ? null : known(10 ** d[this.places[k]]);
    const onward = Math.max(speed, 0); // against its direction a point transfers nothing
    const energy = onward ? 0.5 * mass * onward * onward : 0;
    return { name, link, position, speed, mass, energy, allowed, margin: allowed === null ? null : allowed - onward };
  }
}

function known(value) {
  return Number.isFinite(value) ? value : null;
}
