// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Collisions and contacts of stored states, one every 0.1 s.

import assert from "node:assert/strict";
import { test } from "node:test";
import { collisionNotes } from "../src/chapters.js";
import { CollisionList, eventText, eventsOf, forceText, loadText, touchAt } from "../src/collisions.js";
import { FLAGS, Layout } from "../src/layout.js";
import { Rows } from "../src/rows.js";

const FIELDS = [["norm", 1], ["flags", 1], ["external_torque", 2], ["touched_link", 1], ["touched_confidence", 1]];
const TOUCH = [["touch_unobserved", 1], ["touch_force", 3], ["touch_root", 6], ["load_mass", 1], ["load_deviation", 1], ["load_link", 1]];
const layout = new Layout({
  ...{ dofs: ["turn", "slide"], links: ["base", "upper", "hand"], angular: [true, false], tree: { bodies: [], links: [] } },
  fields: [...FIELDS, ...TOUCH].map(([name, size]) => ({ name, size, of: "" })),
});
const { contact, collision } = FLAGS;

function stored(states) {
  const rows = new Rows(layout.width, 1000);
  states.forEach(({ flags = 0, norm = 0, touch = Array(12).fill(NaN), load = [NaN, NaN, NaN] }, k) => rows.push(k / 10, [norm, flags, 3, -5, ...touch, ...load]));
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

test("times and texts of a summary replace the runs that they overlap", () => {
  const rows = stored([...quiet(2), { flags: collision, norm: 5 }, { flags: collision, norm: 7 }, ...quiet(11), { flags: contact }]);
  const events = eventsOf(rows, layout, [
    { kind: "collision", start: 0.15, end: 0.3000004, told: "turn 5 N m > 2" },
    ...[{ kind: "contact", start: 0.1, end: 0.4 }, { kind: "contact", start: 1.1, end: 1.15 }],
  ]);
  assert.deepEqual(times(events), [["collision", 0.15, 0.3000004, 0.3], ["contact", 1.1, 1.15, 1.1], ["contact", 1.5, 1.5, 1.5]]);
  assert.equal(events[0].told, "turn 5 N m > 2");
  assert.deepEqual(eventsOf(rows, layout, [{ kind: "collision", start: 5, end: 6 }])[2].t, 5); // without states
});

test("the touched link, its force, and the deviation along it", () => {
  const touch = [2, 0.75, 0, 0, 3, 4, 2, 0, 0, 1, 0, 0.5];
  const rows = stored([{ touch }, { touch: [-1, ...touch.slice(1)] }]);
  const found = touchAt(layout, rows.data, rows.base(0));
  assert.deepEqual([found.link, found.confidence, found.size, found.unobserved], ["hand", 0.75, 5, 0]);
  assert.ok(Math.abs(found.deviation - Math.hypot(0.6, 0.4)) < 1e-6);
  assert.equal(forceText(found), "5.00 ±\u00a00.72\u00a0N");
  assert.equal(touchAt(layout, rows.data, rows.base(1)), null);
});

test("a direction that is not observed is a note, and no deviation is invented", () => {
  const events = (unobserved) => eventsOf(stored([{ flags: contact, norm: 1, touch: [1, 0.5, unobserved, 0, 3, 4, ...Array(6).fill(NaN)] }]), layout);
  const texts = (unobserved) => events(unobserved).map((event) => [eventText(event), event.note]);
  assert.deepEqual(texts(1), [["contact: upper (50\u00a0%), ≥ 5.00\u00a0N", "1 direction unobserved"]]);
  assert.deepEqual(texts(3), [["contact: upper (50\u00a0%), 5.00\u00a0N", "torque of slide; force not observable"]]);
});

test("the link of a summary is that of the event", () => {
  const touch = (link, force) => [link, 0.6, 0, 0, 0, force, ...Array(6).fill(NaN)];
  const rows = stored([{ flags: collision, norm: 9, touch: touch(1, 7) }, { flags: collision, norm: 5, touch: touch(2, 4) }]);
  const texts = (link) => eventsOf(rows, layout, [{ kind: "collision", start: 0, end: 0.1, link }]).map(eventText);
  assert.deepEqual(texts(), ["collision: upper (60\u00a0%), 7.00\u00a0N"]);
  assert.deepEqual(texts("hand"), ["collision: hand (60\u00a0%), 4.00\u00a0N"]);
});

test("a reported collision is an event unless states near it are flagged", () => {
  const reported = { kind: "collision", start: 1, end: 1, told: "upper (0.53): |m r| 5 > 3", isReported: true };
  const texts = (states) => eventsOf(stored(states), layout, [reported]).map(eventText);
  assert.deepEqual(texts(quiet(20)), ["collision: upper (0.53): |m r| 5 > 3"]);
  assert.deepEqual(texts([...quiet(12), { flags: collision }, ...quiet(5)]), ["collision: slide, 5.00\u00a0N"]);
  assert.deepEqual(texts([...quiet(9), { flags: contact }, { flags: contact }]), ["collision: upper (0.53): |m r| 5 > 3"]);
});

test("a load with its deviation and link", () => {
  const rows = stored([{ load: [1.2, 0.08, 2] }, {}]);
  assert.deepEqual([0, 1].map((i) => loadText(layout, rows.data, rows.base(i))), ["load 1.20 ±\u00a00.080\u00a0kg at hand", ""]);
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
