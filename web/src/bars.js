// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Columns of the table of joints, and lengths of their bars.

import { exchange, field, hasLimits, hasThresholds, ofLimit, ofThreshold, share } from "./quantities.js";

// Columns: `get` and `mark` of a joint; `signed` for bars in both directions; a fixed `end` of bars; `thresholds` by joint;
// `bar`: length of a joint's bar where it is not the value.
export function columnsOf(layout) {
  const of = (name) => (k) => field(layout, name, k);
  const limited = (name) => (k) => ofLimit(layout, name, k);
  const torque = { id: "torque", title: "torque", signed: true };
  return [
    { id: "share", title: "½ν²", unit: "J", get: (k) => share(layout, k) },
    { id: "exchange", title: "gives νC", unit: "W", signed: true, get: (k) => exchange(layout, k) },
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

// The largest magnitude of the finite values.
export function largestOf(values) {
  return values.reduce((most, value) => (Number.isFinite(value) ? Math.max(most, Math.abs(value)) : most), 0);
}

// Length of a bar, −1 to 1; 0 if unknown.
export function barLength(value, end) {
  return Number.isFinite(value) && end > 0 ? Math.max(-1, Math.min(1, value / end)) : 0;
}
