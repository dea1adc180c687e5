// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// What packing.py has packed: columns of numbers, times, meshes.

export async function bytesOf(id) {
  const text = document.getElementById(`block-${id}`).textContent;
  const packed = Uint8Array.fromBase64 ? Uint8Array.fromBase64(text) : Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// columns: of each [the value of 1, that of one more, how often differences were taken]. Returns an array for each.
export function columnsOf(bytes, rows, columns) {
  return columns.map(([low, step, order], k) => {
    const [high, at] = [2 * k * rows, (2 * k + 1) * rows];
    const out = new Float32Array(rows);
    let [difference, value] = [0, 0];
    for (let i = 0; i < rows; i++) {
      const zigzag = (bytes[high + i] << 8) | bytes[at + i];
      const change = (zigzag >>> 1) ^ -(zigzag & 1);
      difference = order === 2 ? difference + change : change;
      value = (value + difference) & 0xffff;
      out[i] = value ? low + (value - 1) * step : NaN;
    }
    return out;
  });
}

export function timesOf(bytes, rows) {
  const out = new Float64Array(rows);
  let micro = 0;
  for (let i = 0; i < rows; i++) {
    for (let [plane, weight] = [0, 1]; plane < 8; plane++, weight *= 0x100) micro += bytes[plane * rows + i] * weight;
    out[i] = micro / 1e6;
  }
  return out;
}

// A mesh as the server would send it.
export function meshOf(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset);
  const [vertices, triangles] = [view.getUint32(0, true), view.getUint32(4, true)];
  const low = [8, 12, 16].map((at) => view.getFloat32(at, true));
  const span = view.getFloat32(20, true);
  const out = new ArrayBuffer(8 + 12 * vertices + 12 * triangles);
  new Uint32Array(out, 0, 2).set([vertices, triangles]);
  const positions = new Float32Array(out, 8, 3 * vertices);
  const [count, first] = [3 * vertices, 24];
  let whole = 0;
  for (let n = 0; n < count; n++) {
    whole = (whole + bytes[first + n] + (bytes[first + count + n] << 8)) & 0xffff;
    const axis = Math.floor(n / vertices);
    positions[3 * (n % vertices) + axis] = low[axis] + (whole / 65535) * span;
  }
  const indices = new Uint32Array(out, 8 + 12 * vertices, 3 * triangles);
  const [corners, begin] = [3 * triangles, first + 2 * count];
  let index = 0;
  for (let n = 0; n < corners; n++) {
    const zigzag = bytes[begin + n] + bytes[begin + corners + n] * 0x100 + bytes[begin + 2 * corners + n] * 0x10000 + bytes[begin + 3 * corners + n] * 0x1000000;
    index += zigzag % 2 ? -(zigzag + 1) / 2 : zigzag / 2;
    indices[n] = index;
  }
  return out;
}
