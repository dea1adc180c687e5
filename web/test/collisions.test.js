// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Collisions and contacts of stored states, one every 0.1 s.

import assert from "node:assert/strict";
import { test } from "node:test";
import { collisionNotes } from "../src/chapters.js";
import { CollisionList, eventText, eventsOf } from "../src/collisions.js";
import { FLAGS, Layout } from "../src/layout.js";
import { Rows } from "../src/rows.js";

const FIELDS = [["norm", 1], ["flags", 1], ["external_torque", 2], ["touched_link", 3], ["touched_probability", 3]];
const TOUCH = [["touch_interval", 2], ["touch_force", 3]];
const layout = new Layout({
  ...{ dofs: ["turn", "slide"], links: ["base", "upper", "hand"], angular: [true, false], tree: { bodies: [], links: [] } },
  fields: [...FIELDS, ...TOUCH].map(([name, size]) => ({ name, size, of: "" })),
});
const { contact, collision } = FLAGS;

function stored(states) {
  const rows = new Rows(layout.width, 1000);
  states.forEach(({ flags = 0, norm = 0, touch = Array(11).fill(NaN) }, k) => rows.push(k / 10, [norm, flags, 3, -5, ...touch]));
  return rows;
}

const quiet = (count) => Array(count).fill({});
const times = (events) => events.map(({ kind, start, end, t }) => [kind, start, end, t]);

test("runs of flags are events; what rises again within a second belongs to the one before", () => {
  const rows = stored([
    ...[{}, { flags: contact, norm: 1 }, { flags: contact + collision, norm: 9 }, { flags: contact, norm: 2 }, ...quiet(4)],
    ...[{ flags: contact, norm: 3 }, ...quiet(11), { flags: contact, norm: 4 }],
  ]);
  assert.deepEqual(times(eventsOf(rows, layout)), [["collision", 0.1, 0.8, 0.2], ["contact", 2, 2, 2]]);
  const [first] = eventsOf(rows, layout);
  assert.deepEqual([first.touch, eventText(first)], [null, "collision: slide, 5.00\u00a0N"]);
});

test("without a touched link an event has the joint nearest to its threshold", () => {
  const limited = new Layout({ ...layout.json, thresholds: { external_torque: [2, 10] } });
  const [event] = eventsOf(stored([{ flags: collision, norm: 9 }]), limited);
  assert.equal(eventText(event), "collision: turn, 3.00\u00a0N\u00a0m");
});

test("times and texts of a summary replace the runs that they overlap", () => {
  const rows = stored([...quiet(2), { flags: collision, norm: 5 }, { flags: collision, norm: 7 }, ...quiet(11), { flags: contact }]);
  const events = eventsOf(rows, layout, [
    { kind: "collision", start: 0.15, end: 0.3000004, text: "turn 5 N m > 2" },
    ...[{ kind: "contact", start: 0.1, end: 0.4 }, { kind: "contact", start: 1.1, end: 1.15 }],
  ]);
  assert.deepEqual(times(events), [["collision", 0.15, 0.3000004, 0.3], ["contact", 1.1, 1.15, 1.1], ["contact", 1.5, 1.5, 1.5]]);
  assert.equal(events[0].text, "turn 5 N m > 2");
  assert.deepEqual(eventsOf(rows, layout, [{ kind: "collision", start: 5, end: 6 }])[2].t, 5); // without states
});

test("links that may be touched and the interval of the force", () => {
  const touch = (first, second, ...interval) => ({ flags: contact, norm: 1, touch: [first, second, NaN, 0.523, 0.31, NaN, ...interval, 0, 3, 4] });
  const texts = (...of) => eventsOf(stored([touch(...of)]), layout).map(eventText);
  assert.deepEqual(texts(2, 1, 12.4, 24.8), ["contact: hand\u00a052\u00a0% or upper\u00a031\u00a0%, 12 to 25\u00a0N"]);
  assert.deepEqual(texts(2, 1, 4.2, 12.7), ["contact: hand\u00a052\u00a0% or upper\u00a031\u00a0%, ≥ 4.2\u00a0N"]);
  assert.deepEqual(texts(-1, NaN, NaN, NaN), ["contact: slide, 5.00\u00a0N"]);
});

test("the link of a summary is that of the event", () => {
  const touch = (link, force) => [link, NaN, NaN, 0.6, NaN, NaN, force, force, ...Array(3).fill(NaN)];
  const rows = stored([{ flags: collision, norm: 9, touch: touch(1, 7) }, { flags: collision, norm: 5, touch: touch(2, 4) }]);
  const texts = (link) => eventsOf(rows, layout, [{ kind: "collision", start: 0, end: 0.1, link }]).map(eventText);
  assert.deepEqual(texts(), ["collision: upper\u00a060\u00a0%, 7.0 to 7.0\u00a0N"]);
  assert.deepEqual(texts("hand"), ["collision: hand\u00a060\u00a0%, 4.0 to 4.0\u00a0N"]);
});

test("a reported collision is an event unless states near it are flagged", () => {
  const reported = { kind: "collision", start: 1, end: 1, text: "upper (0.53): |m r| 5 > 3", isReported: true };
  const texts = (states) => eventsOf(stored(states), layout, [reported]).map(eventText);
  assert.deepEqual(texts(quiet(20)), ["collision: upper (0.53): |m r| 5 > 3"]);
  assert.deepEqual(texts([...quiet(12), { flags: collision }, ...quiet(5)]), ["collision: slide, 5.00\u00a0N"]);
  assert.deepEqual(texts([...quiet(9), { flags: contact }, { flags: contact }]), ["collision: upper (0.53): |m r| 5 > 3"]);
});

test("next and previous are those of the moment shown", () => {
  let now = 1;
  const list = { events: [{ t: 0.5 }, { t: 1 }, { t: 2 }], nodes: [], shared: { view: { now: () => now }, show: ({ t }) => (now = t) } };
  const seen = [1, 1, -1, -1, -1].map((step) => (CollisionList.prototype.step.call(list, step), now));
  assert.deepEqual(seen, [2, 2, 1, 0.5, 0.5]);
});

test("a report says how many alarms have thresholds, or why collisions are unknown", () => {
  const notes = (judged, missing, text) => collisionNotes({ summary: { observer: { judged, missing, text, gain: 25, observed: 9 } } });
  assert.deepEqual(notes(["norm"], [], ""), [true, ["Thresholds of 1 alarm; observer gain 25.0/s."]]);
  assert.deepEqual(notes(["a", "norm"], [], "")[1], ["Thresholds of 2 alarms; observer gain 25.0/s."]);
  assert.deepEqual(notes([], ["collision.threshold"], "not set"), [false, ["not set"]]);
});
