// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Columns of numbers, times and meshes as packing.py packs them.

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
