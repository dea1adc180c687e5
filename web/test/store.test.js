// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

import assert from "node:assert/strict";
import { test } from "node:test";
import { Rows } from "../src/rows.js";
import { envelope, highEnd, largest, quantile, stacked, tellingRows, timeOfLargest } from "../src/sampling.js";
import { View } from "../src/view.js";

const value = (d, b) => d[b];

function stored(times, numbers = times, capacity = times.length) {
  const rows = new Rows(1, capacity);
  times.forEach((t, k) => rows.push(t, [numbers[k]]));
  return rows;
}

test("rows: empty, one, and the nearest of several", () => {
  const rows = new Rows(2, 10);
  assert.ok(Number.isNaN(rows.first) && Number.isNaN(rows.last));
  assert.deepEqual(rows.range(0, 1), [0, 0]);
  assert.ok(rows.push(1, [5, NaN]));
  assert.deepEqual([rows.first, rows.last, rows.indexAt(-9), rows.nearest(9), rows.data[rows.base(0)]], [1, 1, 0, 0, 5]);
  assert.ok(!rows.push(1, [6, 6]), "the same state again");
  const several = stored([0, 1, 2, 4]);
  assert.deepEqual([-1, 0, 1.4, 1.6, 2.9, 3.1, 9].map((t) => several.nearest(t)), [0, 0, 1, 2, 2, 3, 3]);
  assert.deepEqual(several.range(1.5, 2.5), [1, 4]);
});

test("rows: the oldest go, the store grows, held it drops the newest, time that goes back begins anew", () => {
  const rows = new Rows(1, 600);
  for (let k = 0; k < 1000; k++) rows.push(k, [2 * k]);
  assert.deepEqual([rows.length, rows.first, rows.last, rows.bytes], [600, 400, 999, 600 * 12]);
  for (const i of [0, 250, 599]) assert.equal(rows.data[rows.base(i)], 2 * rows.time(i));
  rows.held = true;
  assert.ok(!rows.push(1000, [0]));
  assert.equal(rows.first, 400);
  rows.held = false;
  assert.ok(rows.push(5, [7]));
  assert.deepEqual([rows.length, rows.first, rows.data[rows.base(0)]], [1, 5, 7]);
});

test("an envelope has every peak, in its order", () => {
  const numbers = Array.from({ length: 1000 }, (_, k) => Math.sin(k / 50));
  [numbers[333], numbers[337], numbers[700]] = [99, -99, NaN];
  const rows = stored(numbers.map((_, k) => k), numbers);
  const [x, y] = envelope(rows, 0, 1000, 20, [value]);
  assert.deepEqual([x.length, y.length], [40, 40]);
  assert.deepEqual(y.slice(12, 14), [99, -99]); // the bucket of rows 300 to 349
  assert.ok(y.every(Number.isFinite) && x.every((t, k) => k === 0 || t > x[k - 1]));
  assert.deepEqual(envelope(stored([0, 1, 2, 3, 4, 5], Array(6).fill(NaN)), 0, 6, 2, [value])[1], [null, null, null, null]);
});

test("a quantile lies between the two nearest values; the end of colours leaves out short peaks", () => {
  assert.deepEqual([0, 0.5, 0.9, 1].map((part) => quantile([4, NaN, 1, 2, Infinity, 3], part)), [1, 2.5, 3.7, 4]);
  assert.deepEqual([quantile([7], 0.98), quantile([NaN], 0.5)], [7, NaN]);
  const numbers = Array.from({ length: 201 }, (_, k) => (k === 50 ? 99 : k === 51 ? NaN : 1));
  const rows = stored(numbers.map((_, k) => k), numbers);
  assert.deepEqual([0.98, 1].map((part) => highEnd(rows, 0, 201, value, part)), [1, 99]);
  assert.equal(highEnd(rows, 60, 201, value, 1), 1, "of the window only");
});

test("few states are drawn as they are, infinite ones are not, and no line goes over a gap", () => {
  assert.deepEqual(envelope(stored([1], [3]), 0, 1, 10, [value]), [[1], [3]]);
  assert.deepEqual(envelope(stored([1]), 0, 0, 10, [value]), [[], []]);
  const rows = stored([0, 0.1, 0.2, 0.3, 5.3], [1, Infinity, -0, 4, 5]);
  assert.deepEqual(envelope(rows, 0, 5, 10, [value]), [[0, 0.1, 0.2, 0.3, 2.8, 5.3], [1, null, -0, 4, null, 5]]);
});

test("a stack ends at the sum; what is not finite adds nothing", () => {
  const rows = new Rows(2, 3);
  [[1, 2], [NaN, 4], [Infinity, 0]].forEach((row, k) => rows.push(k, row));
  const [x, total, own] = stacked(rows, 0, 3, 10, [value, (d, b) => d[b + 1]], value);
  assert.deepEqual([x, total, own], [[0, 1, 2], [3, 4, 0], [2, 4, 0]]);
});

test("the moment of the largest value of a contact, which neither its beginning nor its end is", () => {
  const rows = stored([0, 1, 2, 3, 4, 5, 6], [9, 1, 3, NaN, 4, 2, 9]);
  assert.equal(timeOfLargest(rows, 1, 5, value), 4);
  assert.equal(timeOfLargest(rows, 1.5, 2.5, value), 2);
  assert.equal(timeOfLargest(rows, -3, 0, value), 0);
  for (const [t0, t1] of [[3, 3], [4.2, 4.8], [7, 9], [-9, -8]]) assert.ok(Number.isNaN(timeOfLargest(rows, t0, t1, value)), `${t0} to ${t1}`);
});

test("rows that tell: of each bucket smallest and largest", () => {
  const rows = stored([0, 1, 2, 3, 4, 5, 6, 7], [0, 9, -9, 1, 5, 5, 5, 5]);
  assert.deepEqual(tellingRows(rows, 0, 8, 2, value), [1, 2, 4]);
  assert.deepEqual([...largest(rows, 0, 8, [value, () => NaN])], [9, 0]);
});

// --- the window of time ---

test("live: the window follows; stepping, zooming and going pause it", () => {
  const rows = stored([100, 110, 120, 130]);
  const view = new View(() => rows, true, () => {});
  assert.deepEqual([view.window(), view.now(), view.base()], [[100, 130], 130, 130]);
  view.zoom(1e9);
  assert.equal(view.length, 3600);
  view.zoom(10);
  view.step(-1);
  assert.deepEqual([view.paused, view.now(), view.window()], [true, 120, [120, 130]]);
  view.go(0);
  assert.deepEqual([view.now(), view.window()], [100, [100, 110]]);
  view.zoom(5);
  assert.deepEqual(view.window(), [100, 105]);
  view.go(115);
  assert.deepEqual(view.window(), [112.5, 117.5]);
  view.zoom(0);
  assert.equal(view.length, 0.02);
  view.point(999);
  assert.equal(view.shown(), 130);
  view.follow();
  assert.deepEqual([view.following, view.shown()], [true, 130]);
});

test("a report: the whole, a part, and nothing before there is anything", () => {
  const none = new Rows(1, 2);
  const rows = stored([0, 5, 10]);
  let source = none;
  const view = new View(() => source, false, () => {});
  view.go(3);
  view.step(1);
  assert.equal(view.label(3), "–");
  source = rows;
  view.whole();
  assert.deepEqual([view.window(), view.now(), view.label(5)], [[0, 10], 0, "5.000 s"]);
  view.see(4, 6);
  assert.deepEqual(view.window(), [4, 6]);
  view.see(9, 30);
  assert.equal(view.window()[1], 10);
  assert.deepEqual(view.splits(0, 0.1, 1, 0.25), [0.25, 0.5, 0.75, 1]);
  assert.deepEqual([[-0.5, 0, 0.5], [0, 5]].map((splits) => view.labels(0, splits)), [["−0.5 s", "0", "0.5"], ["0 s", "5"]]);
});
