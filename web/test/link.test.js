// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

import assert from "node:assert/strict";
import { test } from "node:test";
import { fromHash, toHash } from "../src/link.js";

test("a state comes back from its link, exactly", () => {
  const state = {
    ...{ robot: "/cell 2/arm&#1", joint: "ellbögen=1", t: 1764184532.7281234, window: 0.02, colour: "torque" },
    ...{ camera: "1.5,-2,0.25,0,0,1e-7", card: "power", cards: ["power", "parameters"], all: true },
  };
  const hash = toHash(state);
  assert.deepEqual(fromHash(hash), { state, notes: [] });
  assert.deepEqual(fromHash(new URL(hash, "http://localhost/").hash), { state, notes: [] }, "as a browser writes it");
  assert.deepEqual(fromHash(toHash({ t: 0 })), { state: { t: 0 }, notes: [] });
  assert.equal(toHash({ robot: "/arm", cards: ["power", "parameters"] }), "#robot=/arm&cards=power,parameters");
});

test("what is not set is not in the link; no link is no state", () => {
  assert.equal(toHash({ robot: "", joint: null, t: NaN, window: null, cards: [], all: false, other: 1 }), "");
  for (const empty of ["", "#"]) assert.deepEqual(fromHash(empty), { state: {}, notes: [] });
});

test("parts of a link that are none are named, and the others kept", () => {
  const { state, notes } = fromHash("#t=abc&robot=/arm&window=Infinity&constructor=1&cards=a,,b&all=yes&joint=");
  assert.deepEqual(state, { robot: "/arm" });
  const parts = ["t is 'abc'; expected a number", "window is 'Infinity'", "'constructor' is unknown", "cards is 'a,,b'", "all is 'yes'", "joint is ''"];
  assert.ok(parts.every((part, k) => notes[k].startsWith(part)) && notes.length === parts.length, notes.join("\n"));
  for (const noise of ["#%E0%A4%A", "#&&==&", "#💥"]) assert.deepEqual(fromHash(noise).state, {});
});
