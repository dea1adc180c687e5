// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The states of a report: block 0.

import { Rows } from "./rows.js";

export async function rowsOf(layout, count) {
  const bytes = await bytesOf(0);
  const times = new Float64Array(bytes.buffer, 0, count);
  const columns = columnsOf(bytes.subarray(8 * count), count, layout.width);
  const rows = new Rows(columns.length, count);
  times.forEach((t, i) => {
    if (!rows.length || t > rows.last) rows.push(t, columns.map((column) => column[i]));
  });
  return rows;
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
