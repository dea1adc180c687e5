// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The states of a report in one store: those of the whole recording and, around contacts, all of them.

import { Rows } from "./rows.js";
import { bytesOf, columnsOf, timesOf } from "./unpack.js";

export async function rowsOf(layout, tracks) {
  const parts = [];
  for (const track of tracks) parts.push(await read(layout, track));
  return together(parts);
}

function together(parts) {
  const total = parts.reduce((sum, part) => sum + part.times.length, 0);
  const width = parts[0].columns.length;
  const rows = new Rows(width, total);
  [rows.room, rows.times, rows.data] = [total, new Float64Array(total), new Float32Array(total * width)];
  const [overview, ...full] = parts;
  full.sort((a, b) => a.times[0] - b.times[0]);
  let next = 0;
  const upTo = (t) => {
    while (next < overview.times.length && overview.times[next] < t) put(rows, overview, next++);
  };
  for (const part of full) {
    upTo(part.times[0]);
    for (let i = 0; i < part.times.length; i++) put(rows, part, i);
    const end = part.times.at(-1);
    while (next < overview.times.length && overview.times[next] <= end) next++;
  }
  upTo(Infinity);
  return rows;
}

function put(rows, part, i) {
  const t = part.times[i];
  if (rows.length && t <= rows.last) return;
  const base = rows.length * rows.width;
  rows.times[rows.length++] = t;
  for (let k = 0; k < part.columns.length; k++) rows.data[base + k] = Number.isFinite(part.columns[k][i]) ? part.columns[k][i] : NaN;
}

async function read(layout, track) {
  const [first, ...others] = track.blocks;
  const times = timesOf(await bytesOf(first), track.rows);
  const columns = new Array(layout.width);
  for (let p = 0; p < track.parts.length; p++) {
    const { fields, every, columns: scales } = track.parts[p];
    const found = columnsOf(await bytesOf(others[p]), Math.ceil(track.rows / every), scales);
    let k = 0;
    for (const name of fields ?? layout.fields.keys()) {
      const { offset, size } = layout.fields.get(name);
      const own = found.slice(k, k + size);
      k += size;
      if (track.logarithmic.includes(name)) for (const column of own) column.forEach((x, i) => (column[i] = 10 ** x));
      own.forEach((column, n) => (columns[offset + n] = every === 1 ? column : stretched(column, every, track.rows)));
    }
  }
  return { times, columns };
}

// Numbers in between, along straight lines.
function stretched(column, every, rows) {
  const out = new Float32Array(rows);
  for (let i = 0; i < rows; i++) {
    const [k, part] = [Math.floor(i / every), (i % every) / every];
    const next = Math.min(k + 1, column.length - 1);
    out[i] = column[k] + part * (column[next] - column[k]);
  }
  return out;
}
