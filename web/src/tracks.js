// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The states of a report in one store: those of the whole recording and, around contacts, all of them.

import { Rows } from "./rows.js";
import { bytesOf, columnsOf, timesOf } from "./unpack.js";

export async function rowsOf(layout, tracks) {
  return merged(await Promise.all(tracks.map((track) => read(layout, track))));
}

// Of the overview those states at whose times no other track has any.
function merged([overview, ...full]) {
  const total = [overview, ...full].reduce((sum, part) => sum + part.times.length, 0);
  const rows = new Rows(overview.columns.length, total);
  full.sort((a, b) => a.times[0] - b.times[0]);
  let next = 0;
  for (const part of [...full, { times: [Infinity], columns: [] }]) {
    while (overview.times[next] < part.times[0]) put(rows, overview, next++);
    if (part.columns.length) part.times.forEach((_, i) => put(rows, part, i));
    while (overview.times[next] <= part.times.at(-1)) next++;
  }
  return rows;
}

function put(rows, { times, columns }, i) {
  if (!rows.length || times[i] > rows.last) rows.push(times[i], columns.map((column) => column[i]));
}

async function read(layout, { rows, parts, logarithmic, blocks }) {
  const [times, ...packed] = await Promise.all(blocks.map(bytesOf));
  const columns = new Array(layout.width);
  parts.forEach(({ fields, every, columns: scales }, p) => {
    const found = columnsOf(packed[p], Math.ceil(rows / every), scales);
    for (const name of fields) {
      const { offset, size } = layout.fields.get(name);
      found.splice(0, size).forEach((column, k) => {
        const values = logarithmic.includes(name) ? column.map((x) => 10 ** x) : column;
        columns[offset + k] = every > 1 ? stretched(values, every, rows) : values;
      });
    }
  });
  return { times: timesOf(times, rows), columns };
}

// Numbers in between, along straight lines.
function stretched(column, every, rows) {
  return Float32Array.from({ length: rows }, (_, i) => {
    const k = Math.floor(i / every);
    const next = column[Math.min(k + 1, column.length - 1)];
    return column[k] + ((i % every) / every) * (next - column[k]);
  });
}
