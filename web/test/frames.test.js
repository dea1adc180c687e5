// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The page reads what the package writes: fixture.json is by test/support/page_fixture.py. Its arm has links of 1 m, point
// masses of 2 kg and 1 kg at their ends, the elbow at a right angle, and joint rates of 2 and −1 rad/s.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { barLength, columnsOf, largestOf } from "../src/joints.js";
import { csv, FLAGS, Layout, shortFields } from "../src/layout.js";
import { clicked, Legend } from "../src/legend.js";
import { chosenLines, COLOURINGS, othersLine, plotsOf, roundUp } from "../src/quantities.js";
import { exchange, K, massAlong, noiseOf, ofLimit, placeOf, share, thresholdsOf, valueAt } from "../src/quantities.js";
import { Rows } from "../src/rows.js";
import { Tree } from "../src/tree.js";
import { rowsOf } from "../src/tracks.js";

const fixture = JSON.parse(readFileSync(new URL("fixture.json", import.meta.url), "utf8"));
const bytes = (text) => new Uint8Array(Buffer.from(text, "base64"));
const layout = new Layout(fixture.layout);
const [known, unknown] = fixture.frames.map((text) => new Float32Array(bytes(text).slice(8).buffer));
const time = (text) => new DataView(bytes(text).buffer).getFloat64(0, true);
const NU = [2 * Math.sqrt(3), 1]; // K = 6.5 J: 6 J of the shoulder's total rate, 0.5 J of the elbow's

function near(found, expected, tolerance = 1e-6, what = "") {
  const [all, wanted] = [[found].flat(), [expected].flat()];
  assert.equal(all.length, wanted.length, what);
  const isNear = (x, k) => Math.abs(all[k] - x) <= tolerance * Math.max(1, Math.abs(x));
  assert.ok(wanted.every(isNear), `${what}: ${all} is not ${wanted}`);
}

const field = (frame, name) => [...frame.subarray(layout.at(name), layout.at(name) + layout.size(name))];

test("a frame has the numbers of the state", () => {
  assert.deepEqual([layout.width, time(fixture.frames[0])], [known.length, 1.7e9 + 0.25]);
  const expected = {
    ...{ q: [0.3, Math.PI / 2], qd: [2, -1], effort: [5, 1], nu: NU, D: [3, 1], K: 6.5, link_energy: [0, 4, 2.5] },
    ...{ p_effort: 9, p_gravity: 0, p_friction: 0, p_external: 1.25, gravity_torque: [0, 0] },
    ...{ external_torque: [0.5, -0.25], flags: FLAGS.collision, torque_norm: Math.hypot(0.5, 0.25) },
  };
  for (const [name, numbers] of Object.entries(expected)) near(field(known, name), numbers, 1e-6, name);
  near(layout.placements(known, 0)[2].slice(12), [Math.cos(0.3), Math.sin(0.3), 0, 1]);
  near(field(known, "link_velocity"), [-2 * Math.sin(0.3), 2 * Math.cos(0.3), 0]);
});

test("what is unknown is NaN, flagged, and nowhere a number", () => {
  const { estimated, effortMissing, observerInvalid, receiveTime } = FLAGS;
  assert.equal(unknown[layout.at("flags")], estimated + effortMissing + observerInvalid + receiveTime);
  for (const name of ["effort", "p_effort", "external_torque", "norm", "contact_limits_worst", "contact_limits_speed"]) {
    assert.ok(field(unknown, name).every(Number.isNaN), name);
  }
  assert.ok(Number.isNaN(layout.at("nu", 2)) && Number.isNaN(layout.at("nothing")));
  assert.ok(!layout.has("nothing") && layout.has("nu") && layout.size("nothing") === 0);
});

test("the layout: which joint moves which link, short names, names of numbers", () => {
  assert.deepEqual([layout.short, layout.json.end_effector, layout.linkOfDof], [["shoulder", "elbow"], "lower", ["upper", "lower"]]);
  assert.deepEqual(["lower", "base", "nobody"].map((link) => layout.dofOfLink(link)), [1, -1, -1]);
  const names = shortFields(layout).map(({ name }) => name);
  assert.equal(new Set(names).size, layout.width);
  for (const name of ["K", "nu.arm_elbow", "link_energy.lower", "link_velocity.2"]) assert.ok(names.includes(name), name);
  assert.equal(new Layout({ dofs: [], links: ["stone"], fields: [] }).width, 0);
});

test("the layout of a floating base, and of a joint with two degrees of freedom", () => {
  const [links, base] = [["root", "one", "tool"], [0, 1, 2]];
  const dofs = [base, [3, 4], [3, 4]].map((own) => ({ dofs: own, placement: [] }));
  const tree = { bodies: [], links: dofs, link_of_dof: ["root", "root", "root", "one", "one"] };
  const two = { effort: [0, 0, 0, 10, 10] };
  const fields = [{ name: "effort", size: 5 }];
  const floating = new Layout({ dofs: ["base/0", "base/1", "a", "b/0", "b/1"], links, fields, tree, limits: two });
  assert.deepEqual(links.map((link) => floating.dofOfLink(link)), [2, 4, 4]);
  near(COLOURINGS.torque.value(floating)("tool")([0, 0, 0, 2, -5], 0), 50);
});

test("quantities of a frame: shares, exchange, torque in parts of the limit, colours of links", () => {
  const of = (getter, frame = known) => getter(frame, 0);
  near([of(share(layout, 0)), of(share(layout, 1)), of(K(layout))], [6, 0.5, 6.5]);
  assert.ok(Math.abs(of(exchange(layout, 0)) + of(exchange(layout, 1))) < 1e-5);
  near([of(ofLimit(layout, "effort", 0)), of(ofLimit(layout, "effort", 1))], [0.05, 0.01]);
  const unlimited = new Layout({ ...fixture.layout, limits: {} });
  assert.ok(Number.isNaN(of(ofLimit(unlimited, "effort", 0))));
  assert.equal(plotsOf(unlimited).find(({ id }) => id === "torque").unit, "N m");
  const expected = { share: [100 * 6 / 6.5, 100 * 0.5 / 6.5], energy: [4, 2.5], torque: [5, 1], external: [100 * 0.5 / 12, 100 * 0.25 * (known[layout.at("norm")] / 8) / 0.5] };
  for (const [id, numbers] of Object.entries(expected)) {
    const found = ["upper", "lower"].map((link) => of(COLOURINGS[id].value(layout)(link)));
    found.forEach((value, k) => (Number.isNaN(numbers[k]) ? assert.ok(Number.isNaN(value), id) : near(value, numbers[k], 1e-6, id)));
  }
  assert.ok(Number.isNaN(of(COLOURINGS.share.value(layout)("base"))));
  assert.equal(of(COLOURINGS.share.value(layout)("upper"), new Float32Array(layout.width)), 0); // at rest
});

test("external torque is a fraction of the threshold where one is set", () => {
  const without = new Layout({ ...fixture.layout, thresholds: {} });
  const { external } = COLOURINGS;
  assert.deepEqual([external.unit(layout), external.full(layout)], ["% of threshold", 100]);
  assert.deepEqual([external.unit(without), external.full(without)], ["N m", null]);
  near(["upper", "lower"].map((link) => external.value(without)(link)(known, 0)), [0.5, 0.25]);
  for (const [expected, ...given] of [[1, 30, 12], [-1, -30, 12], [0, NaN, 12], [0, Infinity, 12], [0, 1, 0], [0.5, 6, 12]]) {
    assert.equal(barLength(...given), expected, String(given));
  }
  assert.deepEqual(thresholdsOf({ threshold: 12, dof: 0 }), [-12, 12]);
  assert.deepEqual([{ threshold: 8 }, { threshold: null, dof: 0 }, { threshold: Infinity }, {}].map(thresholdsOf), [[8], [], [], []]);
});

test("bars of external torque: of a joint's threshold, or of that of a norm; noise below it stays small", () => {
  const bars = (thresholds) => {
    const one = new Layout({ ...fixture.layout, thresholds });
    return [0, 1].map((k) => columnsOf(one).find(({ id }) => id === "external").bar?.(k)(known, 0));
  };
  const r = known[layout.at("norm")];
  const [norm, torque] = [10 * r, 10 * Math.hypot(0.5, 0.25)];
  const none = { external_torque: [null, null], norm: null, external_torque_norm: null };
  assert.deepEqual(bars(none), [undefined, undefined]);
  near(bars({ ...none, external_torque: [12, 1] }), [0.5 / 12, -0.25]);
  near(bars({ ...none, norm }), [0.1, -0.05]);
  near(bars({ ...none, external_torque_norm: torque }), [0.1, -0.05]);
  near(bars({ ...none, external_torque: [null, 1], norm: 2 * norm, external_torque_norm: torque }), [0.1, -0.25]);
  const judged = new Layout({ ...fixture.layout, thresholds: { ...none, norm } });
  near(["upper", "lower"].map((link) => COLOURINGS.external.value(judged)(link)(known, 0)), [10, 5]);
  assert.equal(COLOURINGS.external.unit(judged), "% of threshold");
});

test("colours of energies tell 32 joints apart, and one infinite value spoils no scale", () => {
  const { share: colouring } = COLOURINGS;
  const places = [30, 3, 0.3].map((percent) => placeOf(colouring, percent, roundUp(30)));
  assert.ok(places[0] > 0.7 && places[1] > 0.2 && places[2] > 0.05, String(places));
  near([0, 0.5, 1].map((place) => valueAt(colouring, place, 100)), [0, 25, 100]);
  near([0, 0.5, 1].map((place) => valueAt(COLOURINGS.torque, place, 100)), [0, 50, 100]);
  for (const x of [Infinity, -Infinity, NaN]) assert.equal(roundUp(x), 1);
  assert.equal(largestOf([1, -3, Infinity, NaN]), 3);
  const rows = new Rows(2, 4);
  rows.push(0, [Infinity, 2]);
  assert.deepEqual([...rows.data.subarray(0, 2)], [NaN, 2]);
});

test("plots: a line for each joint, thresholds, and none of what a report lacks", () => {
  const plots = Object.fromEntries(plotsOf(layout).map((plot) => [plot.id, plot]));
  assert.deepEqual(plots.external.lines.map(({ threshold }) => threshold), [12, null]);
  assert.equal(plots.norm.lines.find(({ name }) => name === "|r|").threshold, 8);
  near(plots.energy.lines.map(({ get }) => get(known, 0)), [6, 0.5]);
  near(plots.power.lines.map(({ get }) => get(known, 0)).slice(0, 4), [9, 0, 0, 1.25]);
});

test("units: once per axis, of joints that turn, slide, or both", () => {
  for (const { id, unit, right, lines } of plotsOf(layout)) {
    assert.equal(right !== undefined, lines.some(({ scale }) => scale === "right"), id);
    assert.ok(unit !== right && lines.every((line) => line.unit === undefined), id);
  }
  const units = (angular) => plotsOf(new Layout({ ...fixture.layout, limits: {}, angular })).map(({ id, unit }) => [id, unit]);
  const torques = ([turns, slides]) => ["external", "norm", "torque", "inertia"].map((id) => Object.fromEntries(units([turns, slides]))[id]);
  assert.deepEqual(torques([true, true]), ["N m", "N m", "N m", "kg m²"]);
  assert.deepEqual(torques([true, false]), ["N m or N", "N m or N", "N m or N", "kg m² or kg"]);
  assert.deepEqual(torques([false, false]), ["N", "N", "N", "kg"]);
});

test("noise: by the mass; none where it is unknown", () => {
  const { J, "N m": torque, "m/s": speed } = noiseOf(layout);
  near([J, torque, speed], [0.015, 0.15, 0.1]); // of 1.5 kg
  assert.equal(noiseOf(new Layout({ ...fixture.layout, scene: null })).J, undefined);
  assert.deepEqual(plotsOf(layout).filter(({ unit, log }) => !log && !(noiseOf(layout)[unit] > 0)).map(({ id }) => id), []);
});

test("colours say what they mean", () => {
  for (const { label, meaning, unit } of Object.values(COLOURINGS)) assert.ok(label && meaning && unit(layout), label);
});

test("of many lines the largest and the selected one, and the others' sum", () => {
  const plot = { lines: [5, 1, NaN, 4, 3].map((x, dof) => ({ dof, get: () => x })) };
  const sizes = plot.lines.map(({ get }) => get());
  assert.deepEqual(chosenLines(plot, sizes, 5, -1), { shown: [0, 1, 2, 3, 4], others: [] });
  assert.deepEqual(chosenLines(plot, sizes, 3, -1), { shown: [0, 3], others: [1, 2, 4] });
  assert.deepEqual(chosenLines(plot, sizes, 3, 2), { shown: [0, 2], others: [1, 3, 4] });
  const { get, name } = othersLine(plot, [1, 2, 4]);
  assert.deepEqual([get(), name], [4, "3 others"]);
  assert.deepEqual([0, NaN, 1, 1.0001, 1.1, 3, 7, 0.03, 2e300].map(roundUp), [1, 1, 1, 1, 1.5, 3, 8, 0.03, 2e300]);
});

test("a click hides a line, or shows it alone", () => {
  const names = ["a", "b", "c"];
  const after = (hidden, name, alone) => [...clicked(new Set(hidden), names, name, alone)];
  assert.deepEqual([after([], "b", false), after(["a"], "b", false), after(["a", "b"], "b", false)], [["b"], ["a", "b"], ["a"]]);
  assert.deepEqual([[], ["b"], ["a"], names].map((hidden) => after(hidden, "b", true)), Array(4).fill(["a", "c"]));
  assert.deepEqual(after(["a", "c"], "b", true), [], "the line was alone: all are shown");
  assert.deepEqual(after(["gone"], "a", false), ["gone", "a"], "a line of which the plot has none now stays hidden");
});

test("a base that moves is found; an arm has none", () => {
  const tree = { bodies: [{ kind: "fixed", placement: [] }, { kind: "planar", placement: [] }], links: [0, 1, 1].map((body) => ({ body, dofs: [], placement: [] })) };
  assert.equal(new Layout({ dofs: [], links: ["map", "cart", "mast"], fields: [], tree }).mobileBase, "cart");
  assert.equal(layout.mobileBase, undefined);
});

test("mobility at the elbow: 3 kg felt along its motion, none at rest", () => {
  const [xx, xy, xz, yy, yz, zz] = field(known, "mobility_root");
  const root = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
  near(massAlong(root, field(known, "link_velocity")), 3, 1e-4);
  assert.ok(Number.isNaN(massAlong(root, [0, 0, 0])) && Number.isNaN(massAlong(root, [NaN, 0, 0])));
});

test("placements of links are the library's, for all kinds of joints, a floating base, locked and mimic joints", () => {
  for (const { tree, q, placements } of fixture.kinematics) {
    const found = new Tree(tree).placements([NaN, ...q], 1);
    placements.forEach((placement, k) => near(found[k], placement, 1e-9, `link ${k}`));
    assert.equal(new Tree(tree).placements(q.map(() => NaN), 0), null);
  }
});

test("a report's states", async () => {
  const { count, block } = fixture.states;
  globalThis.document = { getElementById: (id) => ({ textContent: id === "block-0" ? block : null }) };
  const rows = await rowsOf(layout, count);
  delete globalThis.document;
  const times = [0, 1, 2, 3, 4, 5];
  near(Array.from({ length: rows.length }, (_, i) => rows.time(i)), times, 1e-9);
  times.forEach((t, i) => {
    const row = rows.data.subarray(rows.base(i), rows.base(i + 1) || undefined);
    near(field(row, "K"), 10 * t, 1e-3, `K at ${t}`);
    near(field(row, "link_energy"), [t, t, t], 1e-3, `energy at ${t}`);
    assert.ok(field(row, "D").every(Number.isNaN));
    for (const name of ["q", "nu", "contact_limits_speed", "contact_limits_position"]) near(field(row, name), field(rows.data, name), 1e-4, `${name} at ${t}`);
  });
});

test("the time window as CSV: names are quoted, unknown numbers are empty", async () => {
  const named = new Layout(structuredClone(fixture.layout));
  named.json.contact_limits.points[0].name = '=x,"y"';
  const rows = new Rows(named.width, 9);
  fixture.frames.forEach((text, k) => rows.push(time(text), [known, unknown][k]));
  const [header, ...lines] = (await csv(named, rows, [0, Infinity]).text()).trimEnd().split("\n");
  assert.ok(header.startsWith("t [s],q.arm_shoulder") && header.includes(',"contact_limits_speed.=x,""y"""'), header);
  const names = header.replace(/"[^"]*(""[^"]*)*"/g, "quoted").split(",");
  const column = (name) => lines.map((line) => line.split(",")[names.indexOf(name)]);
  assert.deepEqual([column("effort.arm_elbow"), column("contact_limits_energy.arm"), column("contact_limits_allowed.arm")], [["1", ""], ["0", ""], ["", ""]]);
  assert.equal((await csv(named, rows, [0, 1]).text()).trimEnd().split("\n").length, 1);
});

test("a legend has no noise below a threshold", () => {
  const lines = [{ threshold: 5 }, { threshold: null }, {}];
  const cells = lines.map(() => ({ textContent: "" }));
  const chips = lines.map(() => ({ classList: new Set() }));
  for (const { classList } of chips) Object.assign(classList, { contains: (name) => classList.has(name), toggle: (name) => classList.add(name) });
  Legend.prototype.setValues.call({ lines, cells, chips }, [-5.7e-4, -5.7e-4, 5.7e-4], [12, 12, NaN]);
  assert.deepEqual(cells.map(({ textContent }) => textContent), ["0.0", "0.00", "5.7e−4"]);
  Legend.prototype.setValues.call({ lines, cells, chips }, [-6, -6, 6], [12, 12, NaN]);
  assert.deepEqual(chips.map(({ classList }) => classList.has("above")), [true, false, false]);
});
