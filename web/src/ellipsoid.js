// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The linear part of J M⁻¹ Jᵀ: its axes, and the mass that somebody feels who pushes along a direction.

// Places of the linear 3×3 block in the upper triangle of a symmetric 6×6 matrix, row by row.
const PLACES = [[0, 1, 2], [1, 6, 7], [2, 7, 11]];

export function linearBlock(d, at) {
  return PLACES.map((row) => row.map((k) => d[at + k]));
}

// Eigenvalues and unit eigenvectors of a symmetric 3×3 matrix, by Jacobi's rotations.
export function axesOf(matrix) {
  const a = matrix.map((row) => [...row]);
  const v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let sweep = 0; sweep < 12; sweep++) {
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
      if (Math.abs(a[p][q]) < 1e-18) continue;
      const theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
      const t = Math.sign(theta || 1) / (Math.abs(theta) + Math.sqrt(theta * theta + 1));
      const c = 1 / Math.sqrt(t * t + 1);
      const s = t * c;
      for (let k = 0; k < 3; k++) [a[k][p], a[k][q]] = [c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]];
      for (let k = 0; k < 3; k++) [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
      for (let k = 0; k < 3; k++) [v[k][p], v[k][q]] = [c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]];
    }
  }
  return { values: [a[0][0], a[1][1], a[2][2]], vectors: v }; // vectors in columns
}

// Effective mass [kg] along a velocity: 1 / uᵀAu; NaN at rest.
export function effectiveMass(matrix, velocity) {
  const speed = Math.hypot(...velocity);
  if (!(speed > 1e-4)) return NaN;
  const u = velocity.map((x) => x / speed);
  return 1 / u.reduce((sum, x, i) => sum + x * u.reduce((inner, y, j) => inner + matrix[i][j] * y, 0), 0);
}
