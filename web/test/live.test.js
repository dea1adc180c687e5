// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// What comes from the server: the stream and its restarts, and what the page stores of it. No time passes here.

import assert from "node:assert/strict";
import { afterEach, beforeEach, mock, test } from "node:test";
import { Health } from "../src/health.js";
import { Live } from "../src/live.js";
import { KIND, Stream } from "../src/stream.js";

const settled = async () => {
  for (let k = 0; k < 5; k++) await new Promise(setImmediate);
};

function packet(kind, payload) {
  const head = new Uint8Array(5);
  new DataView(head.buffer).setUint32(0, payload.length, true);
  head[4] = kind;
  return [...head, ...payload];
}

const json = (kind, value) => packet(kind, new TextEncoder().encode(JSON.stringify(value)));

let asked, answers;

beforeEach(() => {
  mock.timers.enable({ apis: ["setTimeout"] });
  [asked, answers] = [[], []];
  globalThis.fetch = async (url) => {
    asked.push(Object.fromEntries(new URLSearchParams(url.split("?")[1])));
    const answer = answers.shift();
    if (answer instanceof Error) throw answer;
    return answer ?? new Promise(() => {});
  };
});

afterEach(() => mock.timers.reset());

function listened() {
  const heard = [];
  const names = ["layout", "frame", "diagnostics", "heartbeat", "contact", "connection", "unknown"];
  const handlers = Object.fromEntries(names.map((name) => [name, (...given) => heard.push([name, ...given])]));
  return [new Stream(handlers), heard];
}

test("packets reach their handlers; the stream comes back after its end", async () => {
  const bytes = [new Float64Array([1.5]), new Float32Array([1, NaN])].flatMap(({ buffer }) => [...new Uint8Array(buffer)]);
  const parts = [json(KIND.layout, { a: 1 }), packet(KIND.frame, bytes), json(KIND.heartbeat, {}), json(9, {})];
  answers.push(new Response(new Uint8Array(parts.flat())));
  const [stream, heard] = listened();
  stream.open("/arm", "hand", 50);
  await settled();
  assert.deepEqual(asked, [{ robot: "/arm", hz: "50", link: "hand" }]);
  const lost = ["connection", "lost", 0.25, "the stream ended"];
  assert.deepEqual(heard, [["layout", { a: 1 }], ["frame", 1.5, new Float32Array([1, NaN])], ["heartbeat", {}], lost]);
  mock.timers.tick(250);
  await settled();
  assert.equal(asked.length, 2);
});

test("tries grow rarer while no server answers", async () => {
  answers.push(...Array.from({ length: 7 }, () => new Error("refused")));
  const [stream, heard] = listened();
  stream.open("/arm", "hand", 50);
  for (let k = 0; k < 7; k++) {
    await settled();
    mock.timers.tick(5000);
  }
  assert.deepEqual(heard.map(([, , seconds]) => seconds), [0.25, 0.5, 1, 2, 4, 5, 5]);
  assert.equal(heard[0][3], "refused");
});

test("a link that the robot lacks is dropped; a robot that is not there is reported", async () => {
  answers.push(new Response('{"error": "no such link"}', { status: 400 }), new Response("", { status: 404 }));
  const [stream, heard] = listened();
  stream.open("/arm", "nobody", 50);
  await settled();
  mock.timers.tick(250);
  await settled();
  assert.deepEqual(asked[1], { robot: "/arm", hz: "50" });
  assert.deepEqual(heard.map(([name, , , why]) => [name, why]), [
    ["connection", "no such link"], ["unknown", undefined], ["connection", "the server says 404"],
  ]);
});

test("five minutes are stored; the same robot keeps them, another one begins anew", () => {
  const laidOut = [];
  const nothing = () => {};
  const onLayout = (_, same) => laidOut.push(Boolean(same));
  const app = { health: new Health(), laidOut: onLayout, came: nothing, marked: nothing };
  const live = new Live(app);
  const { layout, frame } = live.stream.handlers;
  const fields = [{ name: "t", size: 1 }, { name: "q", size: 2 }];
  const robot = { robot: "arm", dofs: ["a", "b"], links: ["base"], end_effector: "base", fields };
  layout(robot);
  for (let k = 0; k < 30_000; k++) frame(k / 50, new Float32Array([k, 0]));
  frame(700, new Float32Array(3)); // of another layout
  const { rows } = live;
  assert.deepEqual([live.frames, rows.length, rows.bytes], [30_000, 15_000, 15_000 * 16]);
  assert.deepEqual([rows.first, rows.last], [300, 599.98]);
  layout({ ...robot, thresholds: { norm: 8 } });
  assert.equal(live.rows, rows);
  layout({ ...robot, dofs: ["a", "c"] });
  assert.deepEqual([live.rows.length, laidOut], [0, [false, true, false]]);
  assert.equal(app.health.connection, "open");
});
