// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The states of a report in one store: those of the whole recording and, around contacts, all of them.

import { Rows } from "./rows.js";

export async function rowsOf(layout, tracks) {
  return merged(await Promise.all(tracks.map((rows, block) => read(layout, rows, block))));
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

async function read(layout, rows, block) {
  const bytes = await bytesOf(block);
  return { times: new Float64Array(bytes.buffer, 0, rows), columns: columnsOf(bytes.subarray(8 * rows), rows, layout.width) };
}

// --- numbers and meshes as meshes.py packs them ---

export async function bytesOf(id) {
  const text = document.getElementById(`block-${id}`).textContent;
  const packed = Uint8Array.fromBase64 ? Uint8Array.fromBase64(text) : Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// The float32 numbers of each column: its second bytes, then its third and its highest ones. The lowest are 0.
export function columnsOf(bytes, rows, count) {
  return Array.from({ length: count }, (_, k) => {
    const column = new Uint8Array(4 * rows);
    for (let plane = 0; plane < 3; plane++) {
      for (let i = 0; i < rows; i++) column[4 * i + plane + 1] = bytes[(3 * k + plane) * rows + i];
    }
    return new Float32Array(column.buffer);
  });
}
