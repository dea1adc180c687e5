// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Normals of a mesh: smooth over flat edges, and not over sharp ones.

const CREASE = Math.cos((35 * Math.PI) / 180); // edges that are sharper stay sharp

// Every corner has the mean of those neighbouring faces' normals that are about as its own. Returns three corners of each
// face, and their normals.
export function creased(positions, indices) {
  const corners = indices.length;
  const faces = corners / 3;
  const normals = new Float32Array(corners); // of faces, with twice their areas as lengths
  const unit = new Float32Array(corners);
  const first = new Uint32Array(positions.length / 3 + 1);
  for (let f = 0; f < faces; f++) {
    const [a, b, c] = [3 * indices[3 * f], 3 * indices[3 * f + 1], 3 * indices[3 * f + 2]];
    const [ux, uy, uz] = [positions[b] - positions[a], positions[b + 1] - positions[a + 1], positions[b + 2] - positions[a + 2]];
    const [vx, vy, vz] = [positions[c] - positions[a], positions[c + 1] - positions[a + 1], positions[c + 2] - positions[a + 2]];
    const [nx, ny, nz] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    const size = Math.sqrt(nx * nx + ny * ny + nz * nz) || 1;
    normals.set([nx, ny, nz], 3 * f);
    unit[3 * f] = nx / size;
    unit[3 * f + 1] = ny / size;
    unit[3 * f + 2] = nz / size;
  }
  for (let k = 0; k < corners; k++) first[indices[k] + 1]++;
  for (let k = 1; k < first.length; k++) first[k] += first[k - 1];
  const next = first.slice();
  const around = new Uint32Array(corners); // faces around each vertex
  for (let k = 0; k < corners; k++) around[next[indices[k]]++] = Math.floor(k / 3);
  const [out, smooth] = [new Float32Array(3 * corners), new Float32Array(3 * corners)];
  for (let k = 0; k < corners; k++) {
    const [vertex, own] = [indices[k], 3 * Math.floor(k / 3)];
    let [x, y, z] = [0, 0, 0];
    for (let n = first[vertex]; n < first[vertex + 1]; n++) {
      const f = 3 * around[n];
      if (unit[f] * unit[own] + unit[f + 1] * unit[own + 1] + unit[f + 2] * unit[own + 2] < CREASE) continue;
      x += normals[f];
      y += normals[f + 1];
      z += normals[f + 2];
    }
    const size = Math.sqrt(x * x + y * y + z * z) || 1;
    for (let axis = 0; axis < 3; axis++) out[3 * k + axis] = positions[3 * vertex + axis];
    smooth[3 * k] = x / size;
    smooth[3 * k + 1] = y / size;
    smooth[3 * k + 2] = z / size;
  }
  return { corners: out, normals: smooth };
}
