// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// What touches would have cost lately: numbers of every point at each moment that was told, in order of time.

import { number } from "./format.js";
import { Rows } from "./rows.js";

const HEAD = ["half", "worst", "estimated"]; // of all points
const NUMBERS = ["speed", "mass", "energy", "allowed", "margin"]; // of a point, behind its position
const WIDTH = 3 + NUMBERS.length;
const NEAR = 0.5; // [s] from a moment, within which something has to have been told of it

export class Touches {
  // seconds that are kept; rate [Hz] at which they are told at most
  constructor(seconds, rate) {
    this.capacity = Math.ceil(seconds * rate);
    this.forget();
  }

  forget() {
    this.names = "";
    this.points = [];
    this.rows = new Rows(HEAD.length, 2);
  }

  get bytes() {
    return this.rows.bytes;
  }

  // json: as the server tells it. Of other points than before, it begins anew.
  take(json) {
    const points = json.points.map(({ name, link }) => ({ name, link }));
    const names = JSON.stringify(points);
    if (names !== this.names) {
      const { held } = this.rows;
      [this.names, this.points] = [names, points];
      this.rows = new Rows(HEAD.length + WIDTH * points.length, this.capacity);
      this.rows.held = held;
    }
    const row = HEAD.map((name) => Number(json[name]));
    for (const point of json.points) row.push(...point.position.map(known), ...NUMBERS.map((name) => known(point[name])));
    this.rows.push(json.t, row);
  }

  // What was told at a moment, as the server told it; null where nothing was.
  at(t) {
    const { rows } = this;
    if (!rows.length) return null;
    const i = rows.nearest(t);
    if (!(Math.abs(rows.time(i) - t) <= NEAR)) return null;
    let k = rows.base(i);
    const next = () => {
      const value = rows.data[k++];
      return Number.isNaN(value) ? null : value;
    };
    const json = { t: rows.time(i), ...Object.fromEntries(HEAD.map((name) => [name, next()])) };
    json.estimated = Boolean(json.estimated);
    json.points = this.points.map((point) => ({
      ...point,
      position: [next(), next(), next()],
      ...Object.fromEntries(NUMBERS.map((name) => [name, next()])),
    }));
    return json;
  }
}

function known(value) {
  return value ?? NaN;
}

// Order of points: the least margin first, and of points without a limit the largest energy.
export function byMargin(points) {
  const margin = (k) => points[k].margin ?? Infinity;
  return points.map((_, k) => k).sort((a, b) => margin(a) - margin(b) || points[b].energy - points[a].energy);
}

// The worst point in words; free: no point has a limit.
export function inWords(worst, free) {
  if (!worst) return free ? "at rest; no limits (contact.limits_file)" : "at rest";
  if (worst.margin !== null) return `least margin: ${worst.name}, ${number(worst.margin)} m/s`;
  return `most energy: ${worst.name}, ${number(worst.energy)} J; no limits${free ? " (contact.limits_file)" : ""}`;
}
