// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The states of a report in one store: those of the whole recording and, around contacts, all of them.

import { Rows } from "./rows.js";

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

// --- columns of numbers, times and meshes as packing.py packs them ---

export async function bytesOf(id) {
  const text = document.getElementById(`block-${id}`).textContent;
  const packed = Uint8Array.fromBase64 ? Uint8Array.fromBase64(text) : Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Fills out with integers from their differences, which have the sign in the lowest bit: lowest bytes come first.
function sums(out, bytes, at, width) {
  const [count, end] = [out.length, 256 ** width];
  let sum = 0;
  for (let n = 0; n < count; n++) {
    let zigzag = 0;
    for (let [plane, weight] = [0, 1]; plane < width; plane++, weight *= 256) zigzag += bytes[at + plane * count + n] * weight;
    sum += zigzag % 2 ? -(zigzag + 1) / 2 : zigzag / 2;
    out[n] = sum < 0 ? sum + end : sum >= end ? sum - end : sum;
    sum = out[n];
  }
  return out;
}

// columns: value of 1 and step of each; 0 is unknown. Returns an array for each.
export function columnsOf(bytes, rows, columns) {
  return columns.map(([low, step], k) => {
    const column = sums(new Float32Array(rows), bytes, 2 * k * rows, 2);
    for (let i = 0; i < rows; i++) column[i] = column[i] ? low + (column[i] - 1) * step : NaN;
    return column;
  });
}

export function timesOf(bytes, rows) {
  return sums(new Float64Array(rows), bytes, 0, 8).map((micro) => micro / 1e6);
}

// A mesh as the server would send it.
export function meshOf(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset);
  const [vertices, triangles] = [view.getUint32(0, true), view.getUint32(4, true)];
  const [x, y, z, span] = [8, 12, 16, 20].map((at) => view.getFloat32(at, true));
  const out = new ArrayBuffer(8 + 12 * vertices + 12 * triangles);
  new Uint32Array(out, 0, 2).set([vertices, triangles]);
  const positions = new Float32Array(out, 8, 3 * vertices);
  const whole = sums(new Uint16Array(3 * vertices), bytes, 24, 2); // all x, then all y, then all z
  positions.forEach((_, n) => (positions[n] = [x, y, z][n % 3] + (whole[(n % 3) * vertices + Math.floor(n / 3)] / 65535) * span));
  sums(new Uint32Array(out, 8 + 12 * vertices, 3 * triangles), bytes, 24 + 6 * vertices, 4);
  return out;
}
