// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Whether the shown state is valid, in a word and a colour.

import { eventText } from "./collisions.js";
import { FLAGS } from "./layout.js";
import { span } from "./format.js";

// Of a status, in the order OK, STALE, WARN, ERROR.
export const severity = (status) => [0, 2, 3, 1][status?.level ?? 0];

// What a status says; name, place and number of a collision or contact are those of the last event, if there is one.
export function statusText({ name, message }, event) {
  return /(^|: )external torque$/.test(name) ? message.replace(/^(collision|contact): [^;]*/, event ? eventText(event) : "$1") : message;
}

const OLD = 1.0; // [s] without a new state, from which on the page is stale

export class Health {
  constructor() {
    this.connection = "connecting"; // connecting, open, lost
    this.heart = null; // last heartbeat
    this.arrived = -Infinity; // of the last frame, by performance.now()
    this.robots = null;
    this.why = "";
    this.error = ""; // with which the server ended the stream
    this.failure = ""; // of the page itself
    this.worst = null; // of the diagnostics: {level, text}; null while all are well
    this.collision = ""; // cause of a collision by the diagnostics; empty without one
  }

  setDiagnostics(list) {
    const collisions = list.filter(({ name, message }) => /(^|: )external torque$/.test(name) && message.startsWith("collision"));
    this.collision = collisions[0]?.message.replace(/^collision:? */, "") ?? "";
    const others = list.filter((one) => !collisions.includes(one)); // a collision has a note of its own
    const worst = others.reduce((most, one) => (severity(one) > severity(most) ? one : most), null);
    const text = worst && [worst.name.replace(/^[^:]*: /, ""), worst.message].filter(Boolean).join(": "); // without its node
    this.worst = worst && { level: severity(worst) > 2 ? "bad" : "warn", text };
  }

  get silence() {
    const since = (performance.now() - this.arrived) / 1000;
    const age = this.heart && performance.now() - this.heart.at < 3000 ? this.heart.age : null;
    return Number.isFinite(age) ? Math.max(age, Math.min(since, age + 1.5)) : since;
  }

  // flags: of the newest frame, or of the one shown while paused; options.event: the collision or contact of that moment.
  judge(flags, options) {
    const verdict = { worst: this.worst, ...this.#judged(flags, options) };
    if (verdict.level === "good" && verdict.worst) verdict.level = verdict.worst.level;
    else if (verdict.level === "warn" && verdict.worst?.level === "bad") verdict.level = "bad";
    return verdict;
  }

  #judged(flags, { paused = false, report = false, rate = NaN, event = null } = {}) {
    const notes = this.notes(flags, event);
    if (report) return { level: "recording", word: "Recording", says: "", notes };
    const error = this.connection === "lost" ? this.error : this.heart?.error;
    if (error) return { level: "bad", word: "Error", says: error, notes: [], dim: true };
    if (this.connection === "lost") {
      return { level: "bad", word: "Disconnected", says: `retrying (${this.why})`, notes: [], dim: true };
    }
    if (this.connection === "connecting") return { level: "warn", word: "Connecting", says: "", notes: [], dim: true };
    if (this.arrived === -Infinity) {
      const says = this.heart?.waiting || (this.robots?.length === 0 ? "no robot found" : "no state received yet");
      return { level: "warn", word: "Waiting", says, notes: [], dim: true };
    }
    const stale = this.silence > OLD;
    if (stale) return { level: "bad", word: "Stale", says: `the last state is ${span(this.silence)} old`, notes, dim: !paused, stale };
    if (paused) return { level: "paused", word: "Paused", says: "", notes };
    const level = notes.some((note) => note.level === "warn") ? "warn" : "good";
    return { level, word: "Live", says: Number.isFinite(rate) && rate > 0 ? `${Math.round(rate)} Hz` : "", notes };
  }

  notes(flags, event) {
    const notes = [];
    if (event) notes.push({ level: event.kind === "collision" ? "bad" : "paused", text: eventText(event) });
    if (flags & FLAGS.estimated) notes.push({ level: "warn", text: "velocities estimated" });
    if (flags & FLAGS.effortMissing) notes.push({ level: "warn", text: "no joint torques" });
    else if (flags & FLAGS.observerInvalid) notes.push({ level: "warn", text: "external torque invalid" });
    if (flags & FLAGS.receiveTime) notes.push({ level: "warn", text: "reception times, no stamps" });
    const difference = this.heart?.difference || (flags & FLAGS.otherModel ? "model differs from the monitor's" : "");
    if (difference) notes.push({ level: "warn", text: difference });
    if (this.failure) notes.push({ level: "bad", text: `the page failed: ${this.failure}` });
    return notes;
  }
}
