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
  late: 16,
  receiveTime: 32,
  otherModel: 64,
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

  dofOfLink(link) {
    return this.dofsOfLink.get(link)?.at(-1) ?? -1;
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
  const { dofs, links, contact } = layout.json;
  const entries = { dofs, links, coordinates: layout.json.coordinates, points: contact?.points.map(({ name }) => name) };
  return [...layout.fields].flatMap(([name, { offset, size, of }]) =>
    Array.from({ length: size }, (_, k) => ({ name: of || size > 1 ? `${name}.${entries[of]?.[k] ?? k}` : name, at: offset + k })),
  );
}
