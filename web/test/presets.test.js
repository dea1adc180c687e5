// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { Layout } from "../src/layout.js";
import { CARDS, cardsOf, DEFAULT, gridOf, PRESETS, textOf } from "../src/presets.js";
import { plotsOf } from "../src/quantities.js";

const fixture = JSON.parse(readFileSync(new URL("fixture.json", import.meta.url), "utf8"));
const plots = plotsOf(new Layout(fixture.layout)).map(({ id }) => id);
const results = ["overall", "limits", "quality", "parameters"];

test("robot, joint table and four cards at first; the results of a report beside them", () => {
  assert.deepEqual(PRESETS[DEFAULT].filter((name) => !results.includes(name)), ["energy", "external", "collisions", "diagnostics"]);
});

test("each card has a name, and is in a preset or in the menu", () => {
  assert.deepEqual([...CARDS].sort(), [...plots, ...results, "contact-limits", "collisions", "diagnostics"].sort());
});

test("names of presets and cards, and back", () => {
  for (const preset of Object.keys(PRESETS)) assert.equal(textOf(cardsOf(preset)), preset);
  assert.deepEqual(cardsOf("power,parameters"), ["power", "parameters"]);
  assert.deepEqual(cardsOf("dynamics,power,parameters"), [...PRESETS.dynamics, "parameters"]);
  assert.equal(textOf(["parameters", "power"]), "parameters,power");
  assert.equal(textOf([...PRESETS.contact].reverse()), "contact");
  for (const text of ["", "all", "power,", "constructor"]) assert.equal(cardsOf(text), null, text);
});

test("no row of cards has a hole", () => {
  const kinds = (text) => [...text].map((letter) => ({ p: "plot", t: "table", w: "words" })[letter]);
  const cases = [
    ["ppww", 3, 2, [2, 2, 1, 1]], ["wwwpp", 3, 2, [1, 1, 2, 2, 2]], ["pwp", 3, 2, [2, 2, 2]], ["pppppp", 3, 2, [1, 1, 1, 1, 1, 1]],
    ["ppppppw", 3, 3, [1, 1, 1, 1, 1, 1, 3]], ["ppppppww", 3, 3, [1, 1, 1, 1, 1, 1, 1, 2]], ["ppw", 1, 1, [1, 1, 1]], ["tppppppw", 3, 3, [2, 1, 1, 1, 1, 1, 1, 1]], ["wtp", 1, 1, [1, 1, 1]], ["", 3, 2, []], ["w", 3, 2, [2]],
  ];
  for (const [letters, most, columns, spans] of cases) assert.deepEqual(gridOf(kinds(letters), most), { columns, spans }, letters);
});
