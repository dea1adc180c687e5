// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

import assert from "node:assert/strict";
import { test } from "node:test";
import { decadeLabel, linearRange, logRange } from "../src/axes.js";
import { faded, hex, jointColour, NEUTRAL, ramp, rampGradient } from "../src/colours.js";
import { clock, decimalsOf, measure, metres, number, percent, powerOfTen, quantity, scaleOf, span, tick } from "../src/format.js";
import { shortened, shortNames, statusName } from "../src/format.js";

function table(name, call, rows) {
  test(name, () => {
    for (const [expected, ...given] of rows) assert.deepEqual(call(...given), expected, `${name}(${given.map(String)})`);
  });
}

table("number", number, [
  ["–", NaN], ["–", Infinity], ["–", -Infinity], ["–", null], ["–", undefined], ["0", 0], ["0", -0],
  ["1.00", 1], ["−1.00", -1], ["12.3", 12.34], ["1235", 1234.6], ["0.123", 0.12345], ["0.0012", 0.00123],
  ["99999", 99999], ["10.0", 9.9997], ["100", 99.96], ["1.0e5", 1e5], ["−1.0e300", -1e300], ["1.0e−4", 1e-4], ["4.9e−324", 5e-324], ["1.2346", 1.23456, 5],
]);
table("measure", measure, [
  ["0.0", -5.7e-4, 5], ["0.0", 0, 5], ["−0.1", -0.06, 5], ["60.3", 60.34, 5], ["1203", 1203.4, 5], ["12", 12.3, 100], // no noise of a threshold
  ["2.91", 2.914, 0.09], ["0.000", 1e-5, 0.09], ["0.000040", 4.01e-5, 1e-4], ["0", 1e-8, 1e-6], ["4.0e−7", 4e-7, 1e-6], ["2.5e5", 2.5e5, 5],
  ["–", NaN, 5], ["5.7e−4", 5.7e-4], ["5.7e−4", 5.7e-4, NaN], ["5.7e−4", 5.7e-4, null],
]);
table("scaleOf", scaleOf, [[5, 5, 100], [10, undefined, 100], [10, null, 100], [10, 0, 100], [NaN, null, NaN]]);
table("tick", tick, [["0", 0, 1], ["0", -0, 1], ["−2.5", -2.5, 2.5], ["0.25", 0.25, 0.05], ["3", 3, 1], ["2.0e5", 2e5, 1e5]]);
table("decimalsOf", decimalsOf, [[0, 1], [0, 20], [1, 2.5], [1, 0.1], [2, 0.25], [2, 0.01]]);
table("powerOfTen", powerOfTen, [
  ["1", 1], ["10", 10], ["10²", 100], ["10⁻³", 1e-3], ["10¹²", 1e12], ["", 20], ["", 0],
  ["", NaN], ["", Infinity],
]);
table("percent", percent, [["50.0 %", 0.5], ["−5.0 %", -0.05], ["0 %", 0], ["100 %", 1], ["–", NaN], ["–", Infinity]]);
table("span", span, [
  ["–", NaN], ["–", Infinity], ["0 ms", 0], ["1.0 ms", 1e-3], ["250 ms", 0.25], ["1.00 s", 1], ["90.0 s", 90],
  ["2.00 min", 120], ["3.00 h", 10800], ["−3.8 ms", -0.0038],
]);
table("shortened", shortened, [["abc", "abc", 3], ["ab…", "abcd", 3], ["a…", "a bcd", 3], ["", "", 3]]);
table("statusName", statusName, [
  ["rates", "rates"], ["rates", "arm/diag_dynamics: rates"], ["driver: a: b", "driver: a: b"],
  ["controller: law", "/arm/diag_dynamics_controller: law"],
]);
table("shortNames", shortNames, [
  [[], []], [["panda_joint1"], ["panda_joint1"]],
  [["shoulder", "elbow"], ["arm_shoulder", "arm_elbow"]],
  [["joint1", "joint2"], ["panda_joint1", "panda_joint2"]],
  [["lwr_0", "lwr_1"], ["lwr_0_joint", "lwr_1_joint"]], // none begins with its number
  [["a", "b_joint_1"], ["a", "b_joint_1"]], [["arm_joint"], ["arm_joint"]], [["_joint", "a_joint"], ["_joint", "a_joint"]],
  [["a", "b"], ["left/a", "left/b"]],
  [["a_x", "b_y"], ["a_x", "b_y"]],
]);

test("clock: seconds of a recording, the time of day of a stamp", () => {
  assert.equal(clock(NaN), "–");
  assert.equal(clock(12.3456), "12.346 s");
  const noon = new Date(2030, 5, 1, 12, 3, 4, 0).getTime() / 1000;
  for (const [expected, part] of [["04.000", 0], ["04.250", 0.25], ["04.007", 0.0069999], ["04.290", 0.29], ["05.000", 0.9996]]) {
    assert.equal(clock(noon + part), `12:03:${expected}`, `${part} s`);
  }
  const wrong = Array.from({ length: 1000 }, (_, ms) => ms).filter((ms) => !clock(noon + ms / 1000).endsWith(`.${String(ms).padStart(3, "0")}`));
  assert.deepEqual(wrong, []);
});

table("quantity", quantity, [["1.50\u00a0N\u00a0m", 1.5, "N m"], ["25.0\u00a01/\u2060s", 25, "1/s"], ["–\u00a0J", NaN, "J"]]);
table("metres", metres, [["0.123", 0.1234], ["−0.100", -0.1], ["0.000", -1e-9], ["–", NaN], ["–", Infinity]]);

table("linearRange", linearRange, [
  [[-1, 1], null, null], [[0, 1], null, null, true], [[0, 2.16], -5, 2, true], [[0, 1e-6], 0, 0, true],
  [[-0.64, 8.64], 0, 0.1, false, [8]], [[-13.92, 13.92], -0.1, 0.2, false, [-12, 12]], [[-13.92, 13.92], null, null, false, [-12, 12]],
  [[-0.5, 0.5], -1e-9, 1e-9, false, [], 0.5], [[0, 0.5], 0, 1e-9, false, [], 0.5], [[0, 0.5], 0, 1e-9, true, [], 0.5], // noise
]);
table("logRange", logRange, [
  [[1e-3, 1], null, null], [[1e-3, 1], 0, 5], [[1e-3, 1], NaN, 1], [[0.1, 100], 0.2, 30], [[1, 100], 10, 10],
]);

test("a linear range contains zero and what is drawn", () => {
  for (const [low, high] of [[2, 3], [-3, -2], [-1, 4], [0, 0], [1e300, 1e300]]) {
    const [from, to] = linearRange(low, high);
    assert.ok(from <= Math.min(low, 0) && to >= Math.max(high, 0) && from < to, `${low} to ${high}: ${from} to ${to}`);
  }
});

test("labels of decades: as many as there is room for", () => {
  const decades = [0, 1, 2, 3, 4].map((k) => 10 ** k);
  assert.deepEqual(decades.map(decadeLabel([1, 1e4], 10)), ["1", "10", "10²", "10³", "10⁴"]);
  assert.deepEqual(decades.map(decadeLabel([1, 1e4], 2)), ["1", "", "10²", "", "10⁴"]);
  assert.equal(decadeLabel([1, 10], 0)(1), "1");
});

test("colours", () => {
  assert.equal(new Set(Array.from({ length: 60 }, (_, k) => jointColour(k))).size, 60);
  for (const k of [0, 15, 16, 59]) assert.match(jointColour(k), /^#[0-9a-f]{6}$/);
  assert.equal(hex([0, 10, 255]), "#000aff");
  assert.equal(faded("#4e79a7", 0.5), "#4e79a780");
  assert.match(rampGradient(), /rgb\(70 96 128\) 0%.*rgb\(226 74 58\) 100%/);
});

table("ramp", ramp, [
  [[70, 96, 128], 0], [[70, 96, 128], -1], [[58, 119, 143], 0.125], [[116, 186, 118], 0.5],
  [[226, 74, 58], 1], [[226, 74, 58], 7],
  [NEUTRAL, NaN], [NEUTRAL, Infinity], [NEUTRAL, undefined],
]);
