// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Downsampling of lines that keeps every peak.

const GAP = 8; // times the median step, above which a line is interrupted

// Points of several quantities over the same times: each bucket has the smallest and the largest of every quantity.
export function envelope(rows, i0, i1, points, getters) {
  return i1 - i0 <= 2 * points ? single(rows, i0, i1, getters) : bucketed(rows, i0, i1, points, getters);
}

function single(rows, i0, i1, getters) {
  const x = [];
  const ys = getters.map(() => []);
  const gap = gapOf(rows, i0, i1);
  for (let i = i0; i < i1; i++) {
    const t = rows.time(i);
    if (i > i0 && t - x[x.length - 1] > gap) {
      x.push(0.5 * (t + x[x.length - 1]));
      for (const y of ys) y.push(null);
    }
    x.push(t);
    const base = rows.base(i);
    for (let s = 0; s < getters.length; s++) ys[s].push(finite(getters[s](rows.data, base)));
  }
  return [x, ...ys];
}

function bucketed(rows, i0, i1, points, getters) {
  const x = [];
  const ys = getters.map(() => []);
  const size = (i1 - i0) / points;
  const { data } = rows;
  const bases = basesOf(rows, i0, i1);
  for (let b = 0; b < points; b++) {
    const [from, to] = [i0 + Math.floor(b * size), i0 + Math.floor((b + 1) * size)];
    x.push(rows.time(from), rows.time((from + to) >> 1));
    for (let s = 0; s < getters.length; s++) {
      const get = getters[s];
      let [low, high, lowAt, highAt] = [Infinity, -Infinity, 0, 0];
      for (let i = from; i < to; i++) {
        const value = get(data, bases[i - i0]);
        if (value < low) {
          low = value;
          lowAt = i;
        }
        if (value > high) {
          high = value;
          highAt = i;
        }
      }
      if (low > high) ys[s].push(null, null);
      else if (lowAt <= highAt) ys[s].push(low, high);
      else ys[s].push(high, low);
    }
  }
  return [x, ...ys];
}

// Begin of rows in the data, cached: all plots of one drawing use the same rows.
let known = { rows: null };

function basesOf(rows, i0, i1) {
  const { start, length } = rows;
  if (known.rows !== rows || known.i0 !== i0 || known.i1 !== i1 || known.start !== start || known.length !== length) {
    const bases = new Int32Array(i1 - i0);
    for (let i = i0; i < i1; i++) bases[i - i0] = rows.base(i);
    known = { rows, i0, i1, start, length, bases };
  }
  return known.bases;
}

// Rows with the minimum and the maximum of a quantity in each bucket: for several quantities of one state.
export function tellingRows(rows, i0, i1, points, getter) {
  const chosen = [];
  if (i1 - i0 <= 2 * points) {
    for (let i = i0; i < i1; i++) chosen.push(i);
    return chosen;
  }
  const size = (i1 - i0) / points;
  for (let b = 0; b < points; b++) {
    const [from, to] = [i0 + Math.floor(b * size), i0 + Math.floor((b + 1) * size)];
    let [low, high, lowAt, highAt] = [Infinity, -Infinity, from, from];
    for (let i = from; i < to; i++) {
      const value = getter(rows.data, rows.base(i));
      if (value < low) [low, lowAt] = [value, i];
      if (value > high) [high, highAt] = [value, i];
    }
    chosen.push(Math.min(lowAt, highAt));
    if (lowAt !== highAt) chosen.push(Math.max(lowAt, highAt));
  }
  return chosen;
}

export function stacked(rows, i0, i1, points, getters, total) {
  const x = [];
  const ys = getters.map(() => []);
  const gap = gapOf(rows, i0, i1);
  const far = i1 - i0 > 2 * points ? Infinity : gap;
  for (const i of tellingRows(rows, i0, i1, points, total)) {
    const t = rows.time(i);
    if (x.length && t - x[x.length - 1] > far) {
      x.push(0.5 * (t + x[x.length - 1]));
      for (const y of ys) y.push(null);
    }
    x.push(t);
    const base = rows.base(i);
    let sum = 0;
    for (let s = getters.length - 1; s >= 0; s--) {
      const value = getters[s](rows.data, base);
      sum += Number.isFinite(value) ? value : 0;
      ys[s].push(sum);
    }
  }
  return [x, ...ys];
}

// The largest magnitude of each quantity over rows.
export function largest(rows, i0, i1, getters, most = 2000) {
  const step = Math.max(1, Math.floor((i1 - i0) / most));
  const found = new Float64Array(getters.length);
  for (let i = i0; i < i1; i += step) {
    const base = rows.base(i);
    for (let s = 0; s < getters.length; s++) {
      const value = Math.abs(getters[s](rows.data, base));
      if (value > found[s]) found[s] = value;
    }
  }
  return found;
}

// Time of the row from t0 to t1 at which a quantity is largest; NaN if it is known at none of them.
export function timeOfLargest(rows, t0, t1, getter) {
  let [time, most] = [NaN, -Infinity];
  for (let i = rows.indexAt(t0); i < rows.length && rows.time(i) <= t1; i++) {
    const value = rows.time(i) < t0 ? NaN : getter(rows.data, rows.base(i));
    if (value > most) [time, most] = [rows.time(i), value];
  }
  return time;
}

function finite(value) {
  return Number.isFinite(value) ? value : null;
}

function gapOf(rows, i0, i1) {
  const count = i1 - i0;
  if (count < 3) return Infinity;
  const steps = [];
  const stride = Math.max(1, Math.floor(count / 64));
  for (let i = i0 + 1; i < i1; i += stride) steps.push(rows.time(i) - rows.time(i - 1));
  steps.sort((a, b) => a - b);
  return Math.max(0.3, GAP * steps[steps.length >> 1]);
}
