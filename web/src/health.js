// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Whether the shown state is valid, in a word and a colour.

import { FLAGS } from "./layout.js";
import { span } from "./format.js";

const OLD = 1.0; // [s] without a new state, from which on the page is stale

export class Health {
  constructor() {
    this.connection = "connecting"; // connecting, open, lost
    this.heart = null; // last heartbeat
    this.arrived = -Infinity; // of the last frame, by performance.now()
    this.robots = null;
    this.why = "";
    this.worst = null; // of the diagnostics: {level, text}; null while all are well
    this.collision = ""; // what the diagnostics say of a collision; empty without one
  }

  setDiagnostics(list) {
    const collisions = list.filter(({ name, message }) => /(^|: )external torque$/.test(name) && message.startsWith("collision"));
    this.collision = collisions[0]?.message ?? "";
    const others = list.filter((one) => !collisions.includes(one)); // a collision has a note of its own
    const worst = others.reduce((most, one) => (one.level > (most?.level ?? 0) ? one : most), null);
    const text = worst && [worst.name.replace(/^[^:]*: /, ""), worst.message].filter(Boolean).join(": "); // without its node
    this.worst = worst && { level: worst.level > 1 ? "bad" : "warn", text };
  }

  get silence() {
    const since = (performance.now() - this.arrived) / 1000;
    const age = this.heart && performance.now() - this.heart.at < 3000 ? this.heart.age : null;
    return Number.isFinite(age) ? Math.max(age, Math.min(since, age + 1.5)) : since;
  }

  // flags: of the newest frame, or of the one shown while paused.
  judge(flags, options) {
    const verdict = { worst: this.worst, ...this.#judged(flags, options) };
    if (verdict.level === "good" && verdict.worst) verdict.level = verdict.worst.level;
    else if (verdict.level === "warn" && verdict.worst?.level === "bad") verdict.level = "bad";
    return verdict;
  }

  #judged(flags, { paused = false, report = false, rate = NaN } = {}) {
    if (report) return { level: "recording", word: "Recording", says: "", notes: this.notes(flags) };
    if (this.connection === "lost") {
      return { level: "bad", word: "Disconnected", says: `retrying (${this.why})`, notes: [], dim: true };
    }
    if (this.connection === "connecting") return { level: "warn", word: "Connecting", says: "", notes: [], dim: true };
    if (this.arrived === -Infinity) {
      const says = this.heart?.waiting || (this.robots?.length === 0 ? "no robot found" : "no state received yet");
      return { level: "warn", word: "Waiting", says, notes: [], dim: true };
    }
    const notes = this.notes(flags, paused ? "" : this.collision);
    const stale = (flags & FLAGS.late) !== 0 || this.silence > OLD;
    if (stale) return { level: "bad", word: "Stale", says: `the last state is ${span(this.silence)} old`, notes, dim: !paused, stale };
    if (paused) return { level: "paused", word: "Paused", says: "", notes };
    const level = notes.some((note) => note.level === "warn") ? "warn" : "good";
    return { level, word: "Live", says: Number.isFinite(rate) && rate > 0 ? `${Math.round(rate)} Hz` : "", notes };
  }

  // collision: text of the diagnostics about it.
  notes(flags, collision = "") {
    const notes = [];
    if (collision || flags & FLAGS.collision) notes.push({ level: "bad", text: collision || "collision" });
    else if (flags & FLAGS.contact) notes.push({ level: "paused", text: "contact" });
    if (flags & FLAGS.estimated) notes.push({ level: "warn", text: "velocities estimated" });
    if (flags & FLAGS.effortMissing) notes.push({ level: "warn", text: "no joint torques" });
    else if (flags & FLAGS.observerInvalid) notes.push({ level: "warn", text: "external torque invalid" });
    if (flags & FLAGS.receiveTime) notes.push({ level: "warn", text: "reception times, no stamps" });
    if (flags & FLAGS.otherModel) notes.push({ level: "warn", text: "model differs from the monitor's" });
    return notes;
  }
}
