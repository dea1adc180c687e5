// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Ranges and labels of a plot's axes.

import { powerOfTen } from "./format.js";

// Range of a linear axis: zero and all thresholds are always inside. A stack begins at zero. smallest: size of the range of
// noise alone.
export function linearRange(low, high, stacked = false, thresholds = [], smallest = 1e-6) {
  if (thresholds.length) [low, high] = [Math.min(low ?? 0, ...thresholds), Math.max(high ?? 0, ...thresholds)];
  if (low === null || high === null) return stacked ? [0, 1] : [-1, 1];
  if (stacked) return [0, Math.max(smallest, 1.08 * high)];
  const size = Math.max(Math.abs(low), Math.abs(high));
  if (size < smallest) return [low < 0 ? -smallest : 0, smallest];
  const room = 0.08 * Math.max(high - low, 0.05 * size);
  return [Math.min(low - room, 0), Math.max(high + room, 0)];
}

// Range of a logarithmic axis: whole decades, at least one.
export function logRange(low, high) {
  if (!(low > 0) || !(high > 0)) return [1e-3, 1];
  const [from, to] = [10 ** Math.floor(Math.log10(low)), 10 ** Math.ceil(Math.log10(high))];
  return to > from ? [from, to] : [from / 10, to * 10];
}

// Labels of decades: all where the axis has room for so many, else every second one, and so on.
export function decadeLabel([low, high], most) {
  const decades = Math.log10(high / low) || 1;
  const every = Math.max(1, Math.ceil(decades / Math.max(1, most)));
  return (x) => (Math.round(Math.log10(x)) % every === 0 ? powerOfTen(x) : "");
}
