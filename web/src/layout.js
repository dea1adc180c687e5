// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Layout of a frame: a double for the time, then float fields in this order.

import { shortNames } from "./format.js";
import { Tree } from "./tree.js";

// Bits of the field flags.
export const FLAGS = {
  estimated: 1,
  effortMissing: 2,
  observerInvalid: 4,
  collision: 8,
  receiveTime: 16,
  otherModel: 32,
  contact: 64,
};

export class Layout {
  constructor(json) {
    this.json = json;
    this.dofs = json.dofs;
    this.short = shortNames(json.dofs);
    this.links = json.links;
    this.scene = json.scene ?? { links: json.links.map((name) => ({ name, visuals: [] })) };
    this.limits = json.limits ?? {};
    this.thresholds = json.thresholds ?? {};
    this.fields = new Map();
    let offset = 0;
    for (const { name, size, of } of json.fields) {
      this.fields.set(name, { offset, size, of });
      offset += size;
    }
    this.width = offset;
    // Degrees of freedom that move each link, and the link that each of them moves.
    const { links = [], link_of_dof: moved = [] } = json.tree ?? {};
    this.tree = new Tree(json.tree ?? { bodies: [], links: [] });
    this.dofsOfLink = new Map(links.map(({ dofs }, k) => [this.links[k], dofs]));
    this.linkOfDof = moved;
  }

  // The link of a base that moves, if there is one.
  get mobileBase() {
    const body = this.tree.bodies.findIndex(({ kind }) => kind === "floating" || kind === "planar");
    return this.links[this.tree.links.findIndex((link) => body >= 0 && link.body === body)];
  }

  dofOfLink(link) {
    return this.dofsOfLink.get(link)?.at(-1) ?? -1;
  }

  // Centre of mass of all that is fixed to a link, in its axes [m].
  centerOf(link) {
    return this.json.tree?.links[this.links.indexOf(link)]?.center ?? [0, 0, 0];
  }

  has(name) {
    return this.fields.has(name) && this.fields.get(name).size > 0;
  }

  // Place of an entry of a field in a frame; NaN if there is none: reading there gives undefined.
  at(name, k = 0) {
    const field = this.fields.get(name);
    return field && k < field.size ? field.offset + k : NaN;
  }

  size(name) {
    return this.fields.get(name)?.size ?? 0;
  }

  // Placements of all links at a frame; null where a position is unknown.
  placements(data, base) {
    return this.tree.placements(data, base + this.fields.get("q").offset);
  }
}

// Name (quantity.joint or quantity.link) and place of each number of a frame.
export function shortFields(layout) {
  const { dofs, links, contact_limits: limits } = layout.json;
  const entries = { dofs, links, coordinates: layout.json.coordinates, points: limits?.points.map(({ name }) => name) };
  return [...layout.fields].flatMap(([name, { offset, size, of }]) =>
    Array.from({ length: size }, (_, k) => ({ name: of || size > 1 ? `${name}.${entries[of]?.[k] ?? k}` : name, at: offset + k })),
  );
}

// The states of a time window as CSV, a column for each number of a frame.
export function csv(layout, rows, [t0, t1]) {
  const columns = shortFields(layout);
  const parts = [["t [s]", ...columns.map(({ name }) => name)].map(quoted).join(",") + "\n"];
  for (let i = rows.indexAt(t0); i < rows.length && rows.time(i) <= t1; i++) {
    if (rows.time(i) < t0) continue;
    const values = columns.map(({ at }) => rows.data[rows.base(i) + at]);
    parts.push(`${rows.time(i)},${values.map((value) => (Number.isFinite(value) ? value : "")).join(",")}\n`);
  }
  return new Blob(parts, { type: "text/csv" });
}

const quoted = (text) => (/[",\n\r]/.test(text) || /^[=+\-@\t]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
