// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The endless answer of the server, packet by packet; comes back by itself after whatever has ended it.

const SHORTEST = 250;
const LONGEST = 5000; // [ms] between two tries
const SILENCE = 4000; // [ms] without a byte, heartbeats included, after which the connection counts as lost

export const KIND = { layout: 0, frame: 1, diagnostics: 2, heartbeat: 3, contact: 4 };

export class Stream {
  // handlers: layout(json), frame(t, values), diagnostics(json), heartbeat(json), contact(json), connection(state, seconds, why)
  constructor(handlers) {
    this.handlers = handlers;
    this.wanted = null;
    this.newest = 0; // number of the stream that is wanted
    this.current = 0; // of the one whose packets count: until another has sent some, the one before it
    this.aborts = new Map();
    this.tries = 0;
  }

  // robot and link as text; a link of null leaves the choice to the server.
  open(robot, link, hz) {
    const same = this.wanted?.robot === robot;
    this.wanted = { robot, link, hz };
    this.tries = 0;
    const turn = ++this.newest;
    if (!same) this.#follow(turn);
    this.#run(turn);
  }

  // Only this one counts from now on.
  #follow(turn) {
    this.current = turn;
    for (const [other, abort] of this.aborts) if (other !== turn) abort.abort();
  }

  async #run(turn) {
    while (turn === this.newest) {
      const abort = new AbortController();
      this.aborts.set(turn, abort);
      let why;
      try {
        why = await this.#read(turn, abort);
      } catch (error) {
        why = error;
      }
      this.aborts.delete(turn);
      if (turn !== this.newest) return;
      this.#follow(turn);
      const pause = Math.min(LONGEST, SHORTEST * 2 ** this.tries++);
      this.handlers.connection("lost", pause / 1000, String(why?.message ?? why ?? "the stream ended"));
      await new Promise((resolve) => setTimeout(resolve, pause));
    }
  }

  async #read(turn, abort) {
    const { robot, link, hz } = this.wanted;
    const query = new URLSearchParams({ robot, hz: String(hz) });
    if (link) query.set("link", link);
    const silent = () => abort.abort(new Error("nothing came"));
    let watch = setTimeout(silent, SILENCE);
    try {
      const answer = await fetch(`stream?${query}`, { signal: abort.signal, cache: "no-store" });
      if (!answer.ok) {
        if (answer.status === 404) this.handlers.unknown();
        if (answer.status === 400 && turn === this.newest) this.wanted.link = null; // another robot has no such link
        throw new Error((await answer.json().catch(() => ({}))).error ?? `the server says ${answer.status}`);
      }
      const packets = new Packets((kind, payload) => this.#take(kind, payload));
      const reader = answer.body.getReader();
      for (;;) {
        const { done, value } = await reader.read();
        if (turn === this.newest && turn !== this.current && !done) this.#follow(turn);
        if (turn !== this.current) return null;
        if (done) return new Error("the stream ended");
        clearTimeout(watch);
        watch = setTimeout(silent, SILENCE);
        packets.take(value);
        this.tries = 0;
      }
    } finally {
      clearTimeout(watch);
    }
  }

  #take(kind, payload) {
    if (kind === KIND.frame) {
      const t = new DataView(payload.buffer, payload.byteOffset, 8).getFloat64(0, true);
      this.handlers.frame(t, new Float32Array(payload.buffer.slice(payload.byteOffset + 8, payload.byteOffset + payload.length)));
      return;
    }
    const json = JSON.parse(new TextDecoder().decode(payload));
    if (kind === KIND.layout) this.handlers.layout(json);
    else if (kind === KIND.diagnostics) this.handlers.diagnostics(json);
    else if (kind === KIND.heartbeat) this.handlers.heartbeat(json);
    else if (kind === KIND.contact) this.handlers.contact(json);
  }
}

// Cuts bytes into packets: length of the payload (u32), kind (u8), payload.
export class Packets {
  constructor(handle) {
    this.handle = handle;
    this.rest = new Uint8Array(0);
  }

  take(bytes) {
    if (this.rest.length) {
      const joined = new Uint8Array(this.rest.length + bytes.length);
      joined.set(this.rest);
      joined.set(bytes, this.rest.length);
      bytes = joined;
    }
    let at = 0;
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
    while (bytes.length - at >= 5) {
      const length = view.getUint32(at, true);
      if (bytes.length - at - 5 < length) break;
      this.handle(bytes[at + 4], bytes.subarray(at + 5, at + 5 + length));
      at += 5 + length;
    }
    this.rest = bytes.slice(at);
  }
}
