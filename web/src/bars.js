// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Numbers and bars of the table of joints, without its elements.

import { exchange, field, hasLimits, hasThresholds, ofLimit, ofThreshold, share } from "./quantities.js";

// Columns: `get` and `mark` of a joint; `signed` for bars in both directions; `adds` where a sum over joints has a meaning;
// `end` of a bar that does not depend on values; `thresholds` by joint; `bar`: length of a joint's bar where it is not the value.
export function columnsOf(layout) {
  const of = (name) => (k) => field(layout, name, k);
  const limited = (name) => (k) => ofLimit(layout, name, k);
  const torque = { id: "torque", title: "torque", signed: true };
  return [
    { id: "share", title: "½ν²", unit: "J", adds: true, get: (k) => share(layout, k) },
    { id: "exchange", title: "gives νC", unit: "W", adds: true, signed: true, get: (k) => exchange(layout, k) },
    hasLimits(layout)
      ? { ...torque, unit: "% of limit", factor: 100, end: 100, get: limited("effort"), mark: limited("gravity_torque") }
      : { ...torque, unit: "N m", get: of("effort"), mark: of("gravity_torque") },
    {
      id: "external",
      title: "external",
      unit: "N m",
      signed: true,
      get: of("external_torque"),
      bar: hasThresholds(layout) ? (k) => ofThreshold(layout, k) : undefined,
      thresholds: layout.thresholds.external_torque ?? [],
    },
  ];
}

// The largest magnitude of some values; what is not finite does not count.
export function largestOf(values) {
  return values.reduce((most, value) => (Number.isFinite(value) ? Math.max(most, Math.abs(value)) : most), 0);
}

// Length of a bar, −1 to 1. Unknown is 0.
export function barLength(value, end) {
  return Number.isFinite(value) && end > 0 ? Math.max(-1, Math.min(1, value / end)) : 0;
}

// The number of several joints together: their sum, or the value of the joint that is nearest to its threshold or limit.
// Values of different joints are fractions of different limits, and have no sum.
export function together(column, values, joints) {
  if (column.adds) return { value: joints.reduce((sum, k) => sum + (Number.isFinite(values[k]) ? values[k] : 0), 0), dof: null };
  const known = joints.filter((k) => Number.isFinite(values[k]));
  if (!known.length) return { value: NaN, dof: null };
  const limits = column.thresholds ?? [];
  const judged = known.filter((k) => limits[k] > 0);
  const size = (k) => Math.abs(values[k]) / (limits[k] > 0 ? limits[k] : 1);
  const dof = (judged.length ? judged : known).reduce((most, k) => (size(k) > size(most) ? k : most));
  return { value: values[dof], dof };
}
