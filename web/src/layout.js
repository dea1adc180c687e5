// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// What a frame consists of: the time as a double, then fields of floats, in the order that the layout says.

import { shortNames } from "./format.js";

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
    this.scene = json.scene ?? { links: json.links.map((name) => ({ name, visuals: [], inertia: null })), joints: [], bounds: null };
    this.limits = json.limits ?? {};
    this.thresholds = json.thresholds ?? {};
    this.fields = new Map();
    let offset = 0;
    for (const { name, size } of json.fields) {
      if (name === "t") continue;
      this.fields.set(name, { offset, size });
      offset += size;
    }
    this.width = offset;
    this.#moves();
  }

  // The link that each degree of freedom moves, and the degrees of freedom that move each link: those of the joint that
  // carries it, or of what it is fixed to.
  #moves() {
    this.dofsOfLink = new Map();
    this.linkOfDof = new Array(this.dofs.length).fill(null);
    const carriers = new Map(this.scene.joints.map((joint) => [joint.child, joint]));
    for (const joint of this.scene.joints) {
      if (!joint.follows) for (const dof of this.#dofsOf(joint)) this.linkOfDof[dof] ??= joint.child;
    }
    this.linkOfDof = this.linkOfDof.map((link) => link ?? this.links[0]); // of a floating base
    const base = this.dofs.map((_, k) => k).filter((k) => this.json.floating_base && k < 6);
    for (const { name } of this.scene.links) {
      let joint = carriers.get(name);
      for (let k = 0; k < carriers.size && joint && !this.#dofsOf(joint).length; k++) joint = carriers.get(joint.parent);
      this.dofsOfLink.set(name, joint ? this.#dofsOf(joint) : base);
    }
  }

  // Joints of several degrees of freedom have names with the joint's before a slash.
  #dofsOf({ name, dof }) {
    if (dof === null || dof === undefined) return [];
    const several = this.dofs.map((_, k) => k).filter((k) => this.dofs[k].startsWith(`${name}/`));
    return several.length ? several : [dof];
  }

  dofOfLink(link) {
    return this.dofsOfLink.get(link)?.at(-1) ?? -1;
  }

  has(name) {
    return this.fields.has(name) && this.fields.get(name).size > 0;
  }

  // Where an entry of a field lies in a frame; of one that is not there, nowhere: reading there gives undefined.
  at(name, k = 0) {
    const field = this.fields.get(name);
    return field && k < field.size ? field.offset + k : NaN;
  }

  size(name) {
    return this.fields.get(name)?.size ?? 0;
  }

  // The link whose ellipsoid and arrow are drawn before a link is chosen.
  get endEffector() {
    return this.json.end_effector;
  }
}

// Names of all numbers of a frame, as quantity.joint or quantity.link, and where they lie.
export function shortFields(layout) {
  const names = [];
  for (const [name, { offset, size }] of layout.fields) {
    for (let k = 0; k < size; k++) names.push({ name: size === 1 ? name : `${name}.${entry(layout, name, size, k)}`, at: offset + k });
  }
  return names;
}

const POSE = ["x", "y", "z", "qx", "qy", "qz", "qw"];

function entry(layout, name, size, k) {
  if (name === "pose") return `${layout.links[Math.floor(k / 7)]}.${POSE[k % 7]}`;
  if (name === "link_energy") return layout.links[k];
  return size === layout.dofs.length ? layout.dofs[k] : String(k);
}
