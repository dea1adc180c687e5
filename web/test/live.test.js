// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// What comes from the server: the stream and its restarts, and what the page stores of it. No time passes here.

import assert from "node:assert/strict";
import { afterEach, beforeEach, mock, test } from "node:test";
import { Health } from "../src/health.js";
import { Live } from "../src/live.js";
import { Stream } from "../src/stream.js";

let sockets;

class Socket {
  static CONNECTING = 0;

  constructor(url) {
    Object.assign(this, { url, closed: false, readyState: 1 });
    sockets.push(this);
  }

  close() {
    this.closed = true;
  }
}

beforeEach(() => {
  mock.timers.enable({ apis: ["setTimeout"] });
  sockets = [];
  Object.assign(globalThis, { WebSocket: Socket, location: { href: "https://robot.local:8420/x?robot=/arm" } });
});

afterEach(() => mock.timers.reset());

function opened() {
  const events = [];
  const names = ["layout", "frame", "diagnostics", "heartbeat", "lost"];
  const handlers = Object.fromEntries(names.map((name) => [name, (...values) => events.push([name, ...values])]));
  const stream = new Stream(handlers);
  stream.open("/arm", "hand", 50);
  return [stream, events];
}

test("messages reach their handlers; the next connection follows the end of one", () => {
  const [, events] = opened();
  const [socket] = sockets;
  assert.equal(String(socket.url), "wss://robot.local:8420/stream?robot=%2Farm&link=hand&hz=50");
  socket.onmessage({ data: '{"layout": {"a": 1}, "later": 2, "heartbeat": {}}' });
  const frame = new Uint8Array([...new Uint8Array(new Float64Array([1.5]).buffer), ...new Uint8Array(new Float32Array([1, NaN]).buffer)]);
  socket.onmessage({ data: frame.buffer });
  assert.deepEqual(events, [["layout", { a: 1 }], ["heartbeat", {}], ["frame", 1.5, new Float32Array([1, NaN])]]);
  socket.onclose({ code: 4404, reason: "no such robot" });
  assert.deepEqual(events.at(-1), ["lost", "no such robot", 404]);
  mock.timers.tick(250);
  assert.equal(sockets.length, 2);
});

test("attempts become rarer while nothing answers; silence is a loss", () => {
  const [, events] = opened();
  for (const pause of [250, 500, 1000, 2000, 4000, 5000, 5000]) {
    const count = sockets.length;
    sockets.at(-1).onclose({ code: 1006, reason: "" });
    mock.timers.tick(pause - 1);
    assert.equal(sockets.length, count);
    mock.timers.tick(1);
    assert.equal(sockets.length, count + 1);
  }
  sockets.at(-1).onmessage({ data: "{}" });
  mock.timers.tick(4000);
  assert.deepEqual(events.at(-1).slice(0, 2), ["lost", "no data"]);
  assert.ok(sockets.at(-1).closed);
  mock.timers.tick(250);
  assert.equal(sockets.length, 9);
});

test("the stream of another link goes on until the new one begins; its end is no loss", () => {
  const [stream, events] = opened();
  const beat = { data: '{"heartbeat": {}}' };
  sockets[0].onmessage(beat);
  stream.open("/arm", "elbow", 50);
  const [old, next] = sockets;
  old.onmessage(beat);
  assert.deepEqual([old.closed, events.length], [false, 2]);
  next.onmessage(beat);
  assert.deepEqual([old.closed, events.length], [true, 3]);
  old.onclose({ code: 1005, reason: "" });
  old.onmessage(beat);
  assert.equal(events.length, 3);
  stream.open("/other", "", 50);
  assert.ok(next.closed);
  next.onmessage(beat);
  assert.equal(events.length, 3);
});

test("five minutes are stored; the same robot keeps them, another one begins anew", () => {
  const laidOut = [];
  const nothing = () => {};
  const onLayout = (_, same) => laidOut.push(Boolean(same));
  const app = { health: new Health(), laidOut: onLayout, came: nothing, marked: nothing };
  const live = new Live(app);
  const { layout, frame } = live.stream.handlers;
  const fields = [{ name: "q", size: 2 }];
  const robot = { robot: "arm", dofs: ["a", "b"], links: ["base"], fields };
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

test("the button sends a push where the server takes pushes", () => {
  globalThis.WebSocket.OPEN = 1;
  const sent = [];
  const health = new Health();
  const live = new Live({ health });
  live.stream.open("/arm", "hand", 50);
  Object.assign(sockets[0], { send: (text) => sent.push(text) });
  sockets[0].onmessage({ data: "{}" });
  live.push();
  health.heart = { pushes: true };
  live.push();
  assert.deepEqual(sent, ["push"]);
});

test("a socket that is not open yet closes once it is: the browser would warn", () => {
  const live = new Live({ health: new Health() });
  live.stream.open("/arm", "hand", 50);
  const [first] = sockets;
  first.readyState = 0;
  live.stream.open("/other", "hand", 50);
  assert.equal(first.closed, false);
  first.onopen();
  assert.equal(first.closed, true);
});
