// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

import assert from "node:assert/strict";
import { test } from "node:test";
import { Health, statusText } from "../src/health.js";
import { FLAGS } from "../src/layout.js";

const status = (level, name, message) => ({ level, name, message });

function healthy() {
  return Object.assign(new Health(), { connection: "open", arrived: performance.now() });
}

function seen(health, flags = 0, options = {}) {
  const { level, word, says, notes } = health.judge(flags, options);
  return [level, word, says, ...notes.map(({ text }) => text)];
}

test("before the first state", () => {
  const health = new Health();
  assert.deepEqual(seen(health), ["warn", "Connecting", ""]);
  health.connection = "open";
  assert.deepEqual(seen(health), ["warn", "Waiting", "no state received yet"]);
  health.robots = [];
  assert.deepEqual(seen(health), ["warn", "Waiting", "no robot found"]);
  health.heart = { waiting: "waiting for robot_description" };
  assert.deepEqual(seen(health), ["warn", "Waiting", "waiting for robot_description"]);
  Object.assign(health, { connection: "lost", why: "refused" });
  assert.deepEqual(seen(health), ["bad", "Disconnected", "retrying (refused)"]);
});

test("what will never come is an error with its reason", () => {
  const health = new Health();
  Object.assign(health, { connection: "open", heart: { waiting: "waiting", error: "the robot cannot be loaded" } });
  assert.deepEqual(seen(health), ["bad", "Error", "the robot cannot be loaded"]);
  Object.assign(health, healthy(), { heart: { error: "states have other joints" } }); // though a state is shown
  assert.deepEqual(seen(health), ["bad", "Error", "states have other joints"]);
  Object.assign(health, { connection: "lost", heart: null, error: "internal error" });
  assert.deepEqual(seen(health), ["bad", "Error", "internal error"]);
  assert.deepEqual(seen(Object.assign(healthy(), { failure: "undefined" })), ["good", "Live", "", "the page failed: undefined"]);
});

test("a robot that differs from the monitor's", () => {
  const health = Object.assign(healthy(), { heart: { difference: "without parameters_file" } });
  assert.deepEqual(seen(health, FLAGS.otherModel), ["warn", "Live", "", "without parameters_file"]);
});

test("live, paused, stale, and a recording", () => {
  const health = healthy();
  assert.deepEqual(seen(health, 0, { rate: 199.6 }), ["good", "Live", "200 Hz"]);
  assert.deepEqual(seen(health, 0, { rate: NaN }), ["good", "Live", ""]);
  assert.deepEqual(seen(health, 0, { paused: true }), ["paused", "Paused", ""]);
  assert.deepEqual(seen(new Health(), FLAGS.estimated, { report: true }), ["recording", "Recording", "", "velocities estimated"]);
  health.arrived -= 5000;
  const stale = seen(health);
  assert.deepEqual(stale.slice(0, 2), ["bad", "Stale"]);
  assert.match(stale[2], /^the last state is 5\.\d\d s old$/); // as the test takes a while
});

test("notes of a state", () => {
  const all = Object.values(FLAGS).reduce((sum, bit) => sum + bit);
  const words = ["velocities estimated", "no joint torques", "reception times, no stamps", "model differs from the monitor's"];
  assert.deepEqual(seen(healthy(), all), ["warn", "Live", "", ...words]);
  assert.deepEqual(seen(healthy(), FLAGS.observerInvalid), ["warn", "Live", "", "external torque invalid"]);
});

test("the worst status colours the verdict, without the name of its node", () => {
  const health = healthy();
  const gap = status(1, "/arm/diag_dynamics: rates", "a gap");
  health.setDiagnostics([status(0, "a", ""), gap, status(2, "diag_dynamics: model", "refused"), status(2, "b", "later")]);
  assert.deepEqual(health.worst, { level: "bad", text: "model: refused" });
  assert.equal(seen(health)[0], "bad");
  health.setDiagnostics([status(1, "rates", "")]);
  assert.deepEqual([health.worst, seen(health)[0]], [{ level: "warn", text: "rates" }, "warn"]);
  health.setDiagnostics([status(3, "torque", "no states"), status(2, "model", "refused")]); // stale is no error
  assert.equal(health.worst.text, "model: refused");
  health.setDiagnostics([status(0, "rates", "well")]);
  assert.deepEqual([health.worst, seen(health)[0]], [null, "good"]);
});

test("a collision is one note of its event, and does not colour the verdict", () => {
  const health = healthy();
  const collision = status(1, "arm/diag_dynamics: external torque", "collision: |m r| 15 N m > 5.14");
  health.setDiagnostics([collision, status(1, "arm/diag_dynamics: pace", "late")]);
  assert.equal(health.worst.text, "pace: late");
  health.setDiagnostics([collision]);
  const event = { kind: "collision", place: "upper (72 %)", number: "24 N" };
  assert.deepEqual([health.worst, health.collision], [null, "|m r| 15 N m > 5.14"]);
  assert.deepEqual(seen(health, FLAGS.collision, { event }), ["good", "Live", "", "collision: upper (72 %), 24 N"]);
  assert.equal(statusText(collision), "collision");
  assert.equal(statusText({ ...collision, message: "contact: upper; joints without effort: j1" }), "contact; joints without effort: j1");
  assert.equal(statusText(collision, event), "collision: upper (72 %), 24 N");
  health.setDiagnostics([status(1, "arm/diag_dynamics: external torque", "no effort of 1: elbow")]);
  assert.deepEqual(health.worst, { level: "warn", text: "external torque: no effort of 1: elbow" });
});
