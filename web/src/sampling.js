// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Downsampling of lines that keeps every peak.

const GAP = 8; // times the median step, above which a line is interrupted

// Points of several quantities over the same times: each bucket has the smallest and the largest of every quantity.
export function envelope(rows, i0, i1, points, getters) {
  const { data } = rows;
  if (i1 - i0 <= 2 * points) {
    const values = (base) => getters.map((get) => finite(get(data, base)));
    return lines(rows, everyRow(i0, i1), gapOf(rows, i0, i1), getters.length, values);
  }
  const x = [];
  const ys = getters.map(() => []);
  const bases = basesOf(rows, i0, i1);
  for (const [from, to] of buckets(i0, i1, points)) {
    x.push(rows.time(from), rows.time((from + to) >> 1));
    getters.forEach((get, s) => {
      const [first, second] = extremes(from, to, (i) => get(data, bases[i - i0]));
      ys[s].push(finite(first.value), finite(second.value));
    });
  }
  return [x, ...ys];
}

// Sums of quantities from the last one on, at rows with the extremes of their total; what is not finite adds nothing.
export function stacked(rows, i0, i1, points, getters, total) {
  const gap = i1 - i0 > 2 * points ? Infinity : gapOf(rows, i0, i1);
  const values = (base) => {
    let sum = 0;
    return [...getters].reverse().map((get) => (sum += finite(get(rows.data, base)) ?? 0)).reverse();
  };
  return lines(rows, tellingRows(rows, i0, i1, points, total), gap, getters.length, values);
}

// Times and values of rows; a gap in time interrupts the lines.
function lines(rows, chosen, gap, count, valuesAt) {
  const x = [];
  const ys = Array.from({ length: count }, () => []);
  for (const i of chosen) {
    const t = rows.time(i);
    if (x.length && t - x.at(-1) > gap) {
      x.push(0.5 * (t + x.at(-1)));
      for (const y of ys) y.push(null);
    }
    x.push(t);
    valuesAt(rows.base(i)).forEach((value, s) => ys[s].push(value));
  }
  return [x, ...ys];
}

// Rows with the minimum and the maximum of a quantity in each bucket: for several quantities of one state.
export function tellingRows(rows, i0, i1, points, getter) {
  if (i1 - i0 <= 2 * points) return everyRow(i0, i1);
  return buckets(i0, i1, points).flatMap(([from, to]) => {
    const [first, second] = extremes(from, to, (i) => getter(rows.data, rows.base(i)));
    return first.at === second.at ? [first.at] : [first.at, second.at];
  });
}

function everyRow(i0, i1) {
  return Array.from({ length: i1 - i0 }, (_, k) => i0 + k);
}

function buckets(i0, i1, points) {
  const start = (b) => i0 + Math.floor((b * (i1 - i0)) / points);
  return Array.from({ length: points }, (_, b) => [start(b), start(b + 1)]);
}

// The smallest and the largest value of a bucket, in the order of their rows.
function extremes(from, to, valueAt) {
  let [low, high, lowAt, highAt] = [Infinity, -Infinity, from, from];
  for (let i = from; i < to; i++) {
    const value = valueAt(i);
    if (value < low) {
      low = value;
      lowAt = i;
    }
    if (value > high) {
      high = value;
      highAt = i;
    }
  }
  const found = [{ value: low, at: lowAt }, { value: high, at: highAt }];
  return lowAt <= highAt ? found : found.reverse();
}

// Begin of rows in the data, cached: all plots of one drawing use the same rows.
let known = { rows: null };

function basesOf(rows, i0, i1) {
  const { start, length } = rows;
  if (known.rows !== rows || known.i0 !== i0 || known.i1 !== i1 || known.start !== start || known.length !== length) {
    known = { rows, i0, i1, start, length, bases: Int32Array.from({ length: i1 - i0 }, (_, k) => rows.base(i0 + k)) };
  }
  return known.bases;
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

// Quantile of known values, between the two nearest ones; NaN if there are none.
export function quantile(values, fraction) {
  const known = values.filter(Number.isFinite).sort((a, b) => a - b);
  const at = fraction * (known.length - 1);
  const [low, high] = [known[Math.floor(at)], known[Math.ceil(at)]];
  return known.length ? low + (at % 1) * (high - low) : NaN;
}

// Quantile of a quantity over rows.
export function highEnd(rows, i0, i1, getter, fraction, most = 300) {
  const step = Math.max(1, Math.ceil((i1 - i0) / most));
  const values = [];
  for (let i = i0; i < i1; i += step) values.push(getter(rows.data, rows.base(i)));
  return quantile(values, fraction);
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
