// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Forward kinematics: placements of links from positions, by the tree that the layout has.

const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

// Placements are 16 numbers, column by column, as three.js has them.
export class Tree {
  constructor({ bodies, links }) {
    this.bodies = bodies.map((body) => ({ ...body, placement: columns(body.placement) }));
    this.links = links.map((link) => ({ ...link, placement: columns(link.placement) }));
  }

  // Placements of all links in the world; q: where positions begin in data. null where one is unknown.
  placements(data, q) {
    const world = [];
    for (const { parent, kind, q: own, multiplier, offset, placement } of this.bodies) {
      const first = q + own;
      const rest = world.length ? product(world[parent], placement) : IDENTITY;
      world.push(kind === "fixed" ? rest : product(rest, MOTIONS[kind](data, first, multiplier, offset)));
    }
    const found = this.links.map(({ body, placement }) => product(world[body], placement));
    return found.every((placement) => placement.every(Number.isFinite)) ? found : null;
  }
}

const MOTIONS = {
  revolute: (data, at, multiplier, offset) => turned(multiplier * data[at] + offset, 0, 0, 0),
  prismatic: (data, at, multiplier, offset) => turned(0, 0, 0, multiplier * data[at] + offset),
  planar: (data, at) => turned(data[at + 2], data[at], data[at + 1], 0),
  floating(data, at) {
    const size = Math.hypot(data[at + 3], data[at + 4], data[at + 5], data[at + 6]);
    const [x, y, z, w] = [3, 4, 5, 6].map((k) => data[at + k] / size);
    return [
      ...[1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w), 0],
      ...[2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w), 0],
      ...[2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y), 0],
      ...[data[at], data[at + 1], data[at + 2], 1],
    ];
  },
};

// Turned about z, then at x, y, z.
function turned(angle, x, y, z) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return [c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, x, y, z, 1];
}

function product(a, b) {
  const out = new Array(16);
  for (let k = 0; k < 16; k++) {
    const [row, column] = [k % 4, k - (k % 4)];
    out[k] = a[row] * b[column] + a[4 + row] * b[column + 1] + a[8 + row] * b[column + 2] + a[12 + row] * b[column + 3];
  }
  return out;
}

function columns(rows) {
  return rows.map((_, k) => rows[4 * (k % 4) + Math.floor(k / 4)]);
}
