// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The websocket of a robot: texts are JSON by name, binary messages are frames. It reconnects after a loss.

const [SHORTEST, LONGEST] = [250, 5000]; // [ms] between two attempts
const SILENCE = 4000; // [ms] without a message, heartbeats included, after which the connection is lost

// A browser warns of a socket that is closed before it is open.
function close(socket) {
  if (socket?.readyState === WebSocket.CONNECTING) socket.onopen = () => socket.close();
  else socket?.close();
}

export class Stream {
  // handlers: layout(json), diagnostics(json), heartbeat(json), frame(t, values), lost(reason, status)
  constructor(handlers) {
    this.handlers = handlers;
  }

  // An empty link is the end effector. The stream of another link goes on until the new one begins.
  open(robot, link, hz) {
    if (robot !== this.robot) this.#close();
    this.robot = robot;
    this.url = new URL(`stream?${new URLSearchParams({ robot, link, hz })}`, location.href);
    this.url.protocol = this.url.protocol.replace("http", "ws");
    this.attempts = 0;
    this.#connect();
  }

  close() {
    this.#close();
    clearTimeout(this.timer);
  }

  send(text) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(text);
  }

  #connect() {
    close(this.next);
    const socket = (this.next = new WebSocket(this.url));
    socket.binaryType = "arraybuffer";
    socket.onmessage = ({ data }) => {
      if (socket === this.next) {
        close(this.socket);
        [this.socket, this.next] = [socket, null];
      }
      if (socket === this.socket) this.#receive(data);
    };
    socket.onclose = ({ code, reason }) => {
      if (socket === this.next && this.socket) this.next = null; // as where all streams are in use: the other one stays
      else if (socket === (this.next ?? this.socket)) this.#lose(reason || "the connection ended", code - 4000);
    };
    this.#watch();
  }

  #close() {
    close(this.next);
    close(this.socket);
    this.next = this.socket = null;
  }

  #watch() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.#lose("no data"), SILENCE);
  }

  #lose(reason, status) {
    this.#close();
    this.handlers.lost(reason, status);
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.#connect(), Math.min(LONGEST, SHORTEST * 2 ** this.attempts++));
  }

  #receive(data) {
    this.attempts = 0;
    this.#watch();
    if (typeof data !== "string") return this.handlers.frame(new Float64Array(data, 0, 1)[0], new Float32Array(data, 8));
    for (const [name, json] of Object.entries(JSON.parse(data))) this.handlers[name]?.(json);
  }
}
