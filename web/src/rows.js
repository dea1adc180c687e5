// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// States in order of time: a bounded store of frames, which drops the oldest first.

const BEGINNING = 256; // rows

export class Rows {
  constructor(width, capacity) {
    this.width = width;
    this.capacity = Math.max(2, capacity);
    this.held = false; // while paused, the newest states are dropped instead
    this.clear();
  }

  clear() {
    this.room = Math.min(BEGINNING, this.capacity);
    this.times = new Float64Array(this.room);
    this.data = new Float32Array(this.room * this.width);
    this.start = 0;
    this.length = 0;
  }

  // Returns whether the state was stored. A time before the last one starts a new history.
  push(t, values) {
    if (this.length && t <= this.last) {
      if (t === this.last) return false;
      this.clear();
    }
    if (this.length === this.room && this.room < this.capacity) this.#grow();
    if (this.length === this.capacity) {
      if (this.held) return false;
      this.start = (this.start + 1) % this.room;
      this.length--;
    }
    const row = (this.start + this.length) % this.room;
    this.times[row] = t;
    const base = row * this.width;
    this.data.set(values, base);
    // One infinite value would spoil every scale.
    for (let k = base; k < base + this.width; k++) if (!Number.isFinite(this.data[k])) this.data[k] = NaN;
    this.length++;
    return true;
  }

  #grow() {
    const room = Math.min(this.capacity, 2 * this.room);
    const times = new Float64Array(room);
    const data = new Float32Array(room * this.width);
    times.set(this.times);
    data.set(this.data); // start is 0 until the store is full
    [this.room, this.times, this.data] = [room, times, data];
  }

  get bytes() {
    return this.times.byteLength + this.data.byteLength;
  }

  get first() {
    return this.length ? this.time(0) : NaN;
  }

  get last() {
    return this.length ? this.time(this.length - 1) : NaN;
  }

  time(i) {
    return this.times[(this.start + i) % this.room];
  }

  // Where row i begins in data.
  base(i) {
    return ((this.start + i) % this.room) * this.width;
  }

  // The last row that is not later than t; the first one where all are.
  indexAt(t) {
    let [low, high] = [0, this.length - 1];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.time(middle) <= t) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  // The row nearest to t.
  nearest(t) {
    const i = this.indexAt(t);
    return i + 1 < this.length && this.time(i + 1) - t < t - this.time(i) ? i + 1 : i;
  }

  // Rows from just before t0 to just after t1, so that lines reach the edges.
  range(t0, t1) {
    if (!this.length) return [0, 0];
    return [this.indexAt(t0), Math.min(this.length, this.indexAt(t1) + 2)];
  }
}
