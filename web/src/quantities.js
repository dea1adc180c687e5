// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Quantities of a state: lines of plots, columns of the table of joints, colours of links.
// A getter takes the store's floats and the begin of a row.

import { jointColour, OTHERS } from "./colours.js";

export const field = (layout, name, k = 0) => {
  const at = layout.at(name, k);
  return (d, b) => d[b + at];
};

// Energy share ½ν_k² of a total joint rate.
export function share(layout, k) {
  const at = layout.at("nu", k);
  return (d, b) => 0.5 * d[b + at] * d[b + at];
}

// ν_kC_k: power that a joint gives to others by the Coriolis term; the sum over joints is zero.
export function exchange(layout, k) {
  const [nu, c] = [layout.at("nu", k), layout.at("coriolis", k)];
  return (d, b) => d[b + nu] * d[b + c];
}

// A torque as a fraction of the joint's limit; NaN without one.
export function ofLimit(layout, name, k) {
  const at = layout.at(name, k);
  const limit = layout.limits.effort?.[k];
  return limit > 0 ? (d, b) => d[b + at] / limit : () => NaN;
}

export const K = (layout) => field(layout, "K");

export function hasLimits(layout) {
  return (layout.limits.effort ?? []).some((limit) => limit > 0);
}

export function hasThresholds({ thresholds }) {
  return [...(thresholds.external_torque ?? []), thresholds.norm, thresholds.external_torque_norm].some((threshold) => threshold > 0);
}

// |r| or |m r| as a fraction of its threshold, the larger of the two; NaN without such a threshold.
export function ofNormThresholds(layout) {
  const { norm, external_torque_norm: torqueNorm } = layout.thresholds;
  const ratios = [["norm", norm], ["torque_norm", torqueNorm]].filter(([, threshold]) => threshold > 0);
  const getters = ratios.map(([name, threshold]) => [field(layout, name), threshold]);
  return (d, b) => getters.map(([get, threshold]) => get(d, b) / threshold).reduce(largestKnown, NaN);
}

// External torque of a joint as a fraction of its threshold. A joint without one has its part of the norms' fraction: the
// joint with the largest external torque has all of it.
export function ofThreshold(layout, k) {
  const own = field(layout, "external_torque", k);
  const threshold = layout.thresholds.external_torque?.[k];
  if (threshold > 0) return (d, b) => own(d, b) / threshold;
  const all = layout.dofs.map((_, n) => field(layout, "external_torque", n));
  const together = ofNormThresholds(layout);
  return (d, b) => {
    const largest = all.map((get) => Math.abs(get(d, b))).reduce(largestKnown, NaN);
    return largest > 0 ? (together(d, b) * own(d, b)) / largest : together(d, b) * own(d, b);
  };
}

// Values at which a plot of some lines draws thresholds: on both sides of zero for a joint, above it for a norm.
export function thresholdsOf(line) {
  if (!(line.threshold > 0) || !Number.isFinite(line.threshold)) return [];
  return line.dof === undefined ? [line.threshold] : [-line.threshold, line.threshold];
}

// Sizes of quantities of a robot of this mass below which all is noise, by their units: energies at 0.1 m/s, torques of a
// hundredth of the weight at 1 m.
export function noiseOf(layout) {
  const half = 0.5 * layout.scene.links.reduce((sum, { mass }) => sum + mass, 0); // [kg]
  const rates = { rad: 0.1, m: 0.1, "rad/s": 0.1, "m/s": 0.1, "% of limit": 1 };
  if (!(half > 0)) return rates;
  const [energy, torque, root] = [0.01 * half, 0.1 * half, 0.1 * Math.sqrt(half)];
  return { ...rates, J: energy, W: energy, "N m": torque, N: torque, "N m or N": torque, "√J": root, "√J/s": root };
}

// A unit of joints that turn, of joints that slide, or of both.
export function unitOf(layout, turning, sliding) {
  const { angular = [] } = layout.json;
  const units = [[true, turning], [false, sliding]].filter(([turns]) => angular.includes(turns)).map(([, unit]) => unit);
  return units.join(" or ") || turning;
}

function ofJoints(layout, getter, { colours = true } = {}) {
  return layout.dofs.map((name, k) => ({
    name,
    short: layout.short[k],
    dof: k,
    colour: colours ? jointColour(k) : undefined,
    get: getter(k),
  }));
}

const single = (layout, name, label, colour, extra = {}) => ({
  name: label,
  short: label,
  colour,
  get: field(layout, name),
  ...extra,
});

const COLOURS = { effort: "#4e79a7", gravity: "#b07aa1", friction: "#9c755f", external: "#e15759", dK: "#59a14f" };

// All plots of a robot, in their order. `unit`: of the axis on the left; `right`: of the axis on the right, if a line has it;
// `twin`: a second, dashed line of the same joint.
export function plotsOf(layout) {
  const limits = hasLimits(layout);
  const torque = unitOf(layout, "N m", "N");
  const thresholds = layout.thresholds.external_torque ?? [];
  return [
    {
      id: "energy",
      title: "Kinetic energy",
      unit: "J",
      stacked: true,
      total: K(layout),
      lines: ofJoints(layout, (k) => share(layout, k)),
      help: "Kinetic energy K, stacked by joint: energy shares ½ν² of the total joint rates.",
    },
    {
      id: "power",
      title: "Power balance",
      unit: "W",
      lines: [
        single(layout, "p_effort", "joint torque", COLOURS.effort),
        single(layout, "p_gravity", "gravity", COLOURS.gravity),
        single(layout, "p_friction", "friction", COLOURS.friction),
        single(layout, "p_external", "external", COLOURS.external),
        single(layout, "dK", "dK/dt", COLOURS.dK, { width: 2 }),
      ],
      help: "Power into the kinetic energy. Joint torque, gravity, friction and external torque add up to dK/dt if the model is right.",
    },
    {
      id: "external",
      title: "External torque",
      unit: torque,
      lines: ofJoints(layout, (k) => field(layout, "external_torque", k)).map((line) => ({
        ...line,
        threshold: thresholds[line.dof] ?? null,
      })),
      help: "External torque m r of the disturbance observer, by joint. Dashed: alarm thresholds.",
    },
    {
      id: "norm",
      title: "External torque norms",
      unit: torque,
      right: "√J/s",
      lines: [
        single(layout, "torque_norm", "|m r|", "#e15759", { threshold: layout.thresholds.external_torque_norm ?? null }),
        single(layout, "norm", "|r|", "#f28e2b", { threshold: layout.thresholds.norm ?? null, scale: "right" }),
      ],
      help: "Norms of the external torque m r (left) and of the residual r (right). Dashed: alarm thresholds.",
    },
    {
      id: "exchange",
      title: "Coriolis exchange νₖCₖ",
      unit: "W",
      lines: ofJoints(layout, (k) => exchange(layout, k)),
      help: "Power exchanged between joints by the Coriolis term: positive if a joint gives, negative if it receives. The sum is zero.",
    },
    {
      id: "torque",
      title: "Joint torque",
      unit: limits ? "% of limit" : torque,
      factor: limits ? 100 : 1,
      lines: ofJoints(layout, (k) => (limits ? ofLimit(layout, "effort", k) : field(layout, "effort", k))).map((line) => ({
        ...line,
        twin: limits ? ofLimit(layout, "gravity_torque", line.dof) : field(layout, "gravity_torque", line.dof),
      })),
      help: "Measured joint torque. Dashed: gravity torque.",
    },
    {
      id: "inertia",
      title: "Articulated inertia D",
      unit: unitOf(layout, "kg m²", "kg"),
      log: true,
      lines: ofJoints(layout, (k) => field(layout, "D", k)),
      help: "Inertia at each joint while all outboard joints are free.",
    },
  ];
}

// The largest lines that fit into a plot, and the others.
export function chosenLines(plot, sizes, most, selected) {
  const all = plot.lines.map((line, k) => k);
  if (all.length <= most) return { shown: all, others: [] };
  const order = [...all].sort((a, b) => (sizes[b] || 0) - (sizes[a] || 0));
  const shown = order.slice(0, most - 1);
  const wanted = plot.lines.findIndex((line) => line.dof !== undefined && line.dof === selected);
  if (wanted >= 0 && !shown.includes(wanted)) shown[shown.length - 1] = wanted;
  shown.sort((a, b) => a - b);
  return { shown, others: all.filter((k) => !shown.includes(k)) };
}

export function othersLine(plot, others) {
  const getters = others.map((k) => plot.lines[k].get);
  return {
    name: `${others.length} others`,
    short: `${others.length} others`,
    colour: OTHERS,
    get: (d, b) => getters.reduce((sum, get) => sum + (get(d, b) || 0), 0),
  };
}

// Quantities that links can be coloured by. `value`: of each link. `full`: the value that is 100 %; null where there is none. `root`: whether colours go by the root of the value: of 32 joints one has some per cent of the energy.
// A link has the energy share of all degrees of freedom of its joint, and of its torques the largest.
export const COLOURINGS = {
  share: {
    label: "Energy share",
    meaning: "kinetic energy of the joint",
    unit: () => "% of K",
    value: (layout) => {
      const total = K(layout);
      const part = (own) => (d, b) => (total(d, b) > 1e-9 ? (100 * own(d, b)) / total(d, b) : 0);
      return byDof(layout, (k) => part(share(layout, k)), (a, b) => a + b);
    },
    full: () => 100,
    root: true,
  },
  energy: {
    label: "Link energy",
    meaning: "kinetic energy of the link",
    unit: () => "J",
    value: (layout) => (link) => field(layout, "link_energy", layout.links.indexOf(link)),
    full: () => null,
    root: true,
  },
  torque: {
    label: "Joint torque",
    meaning: "joint torque",
    unit: () => "% of limit",
    value: (layout) => {
      const part = (of) => (d, b) => 100 * Math.abs(of(d, b));
      return byDof(layout, (k) => part(ofLimit(layout, "effort", k)), Math.max);
    },
    full: () => 100,
  },
  external: {
    label: "External torque",
    meaning: "external torque",
    unit: (layout) => (hasThresholds(layout) ? "% of threshold" : "N m"),
    value: (layout) => {
      const [own, factor] = hasThresholds(layout) ? [ofThreshold, 100] : [(_, k) => field(layout, "external_torque", k), 1];
      const part = (get) => (d, b) => factor * Math.abs(get(d, b));
      return byDof(layout, (k) => part(own(layout, k)), largestKnown);
    },
    full: (layout) => (hasThresholds(layout) ? 100 : null),
  },
};

// Function of a state: the value of each link, by its name.
export function linkValues(layout, colouring) {
  const value = COLOURINGS[colouring].value(layout);
  const getters = layout.scene.links.map(({ name }) => [name, value(name)]);
  return (d, b) => new Map(getters.map(([name, get]) => [name, get(d, b)]));
}

// Place of a value on the colour ramp, 0 to 1, and the value of a place.
export function placeOf({ root }, value, end) {
  return root ? Math.sqrt(value / end) : value / end;
}

export function valueAt({ root }, place, end) {
  return end * (root ? place * place : place);
}

function largestKnown(a, b) {
  return Number.isNaN(a) ? b : Number.isNaN(b) ? a : Math.max(a, b);
}

function byDof(layout, getter, together) {
  return (link) => {
    const getters = (layout.dofsOfLink.get(link) ?? []).map(getter);
    if (!getters.length) return () => NaN;
    return (d, b) => getters.map((get) => get(d, b)).reduce((x, y) => together(x, y));
  };
}

// The next of 1, 1.5, 2, 3, 4, 5, 6, 8 times a power of ten.
export function roundUp(x) {
  if (!(x > 0) || !Number.isFinite(x)) return 1;
  const power = 10 ** Math.floor(Math.log10(x));
  return [1, 1.5, 2, 3, 4, 5, 6, 8, 10].map((k) => k * power).find((end) => end >= x * 0.999);
}

// Reflected mass [kg] along a velocity v, v·v/|Sv|² with the root S of the mobility; NaN at rest.
export function massAlong(root, velocity) {
  const speed = Math.hypot(...velocity);
  return speed > 1e-4 ? (speed / lengthOf(root, velocity)) ** 2 : NaN;
}

// Length of a vector that a matrix has mapped.
export function lengthOf(matrix, vector) {
  return Math.hypot(...matrix.map((row) => row.reduce((sum, x, k) => sum + x * vector[k], 0)));
}
