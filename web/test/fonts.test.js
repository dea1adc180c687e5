// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Letters: at least 12 px on a screen of 1440 px and below, and 14 px on one of 2560 px.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

const read = (name) => readFileSync(new URL(`../src/${name}`, import.meta.url), "utf8");
const css = read("page.css");
const [, least, share, offset, most] = /font-size: clamp\(([\d.]+)px, ([\d.]+)vw \+ ([\d.]+)px, ([\d.]+)px\)/.exec(css).map(Number);
const rootAt = (width) => Math.min(most, Math.max(least, (share * width) / 100 + offset));
const small = Number(/--small: ([\d.]+)rem/.exec(css)[1]);

test("the smallest letters of the page", () => {
  for (const [width, pixels] of [[390, 12], [1280, 12], [1440, 12], [2560, 14], [3840, 14]]) assert.ok(small * rootAt(width) >= pixels, `${width} px`);
});

test("no letters are smaller", () => {
  const sizes = [...css.matchAll(/font(?:-size)?: ([\d.]+)(rem|px|em)/g)].map(([, size, unit]) => [Number(size), unit]);
  assert.ok(sizes.length > 10);
  assert.deepEqual(sizes.filter(([size, unit]) => unit !== "rem" || size < small), []);
  assert.equal(Number(/LETTERS = ([\d.]+)/.exec(read("plot.js"))[1]), small);
});
