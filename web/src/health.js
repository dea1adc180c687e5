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
  }

  setDiagnostics(list) {
    const worst = list.reduce((most, one) => (one.level > (most?.level ?? 0) ? one : most), null);
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
    const notes = this.notes(flags);
    const stale = (flags & FLAGS.late) !== 0 || this.silence > OLD;
    if (stale) return { level: "bad", word: "Stale", says: `the last state is ${span(this.silence)} old`, notes, dim: !paused, stale };
    if (paused) return { level: "paused", word: "Paused", says: "", notes };
    const level = notes.some((note) => note.level === "warn") ? "warn" : "good";
    return { level, word: "Live", says: Number.isFinite(rate) && rate > 0 ? `${Math.round(rate)} Hz` : "", notes };
  }

  notes(flags) {
    const notes = [];
    if (flags & FLAGS.collision) notes.push({ level: "bad", text: "contact" });
    if (flags & FLAGS.estimated) notes.push({ level: "warn", text: "velocities estimated" });
    if (flags & FLAGS.effortMissing) notes.push({ level: "warn", text: "no efforts" });
    else if (flags & FLAGS.observerInvalid) notes.push({ level: "warn", text: "external torque not valid" });
    if (flags & FLAGS.receiveTime) notes.push({ level: "warn", text: "receive times instead of stamps" });
    if (flags & FLAGS.otherModel) notes.push({ level: "warn", text: "links of another model" });
    return notes;
  }
}
