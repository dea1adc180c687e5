// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Meshes as the server sends them: numbers of vertices and triangles (u32), positions (float32), indices (u32).

import { BufferAttribute, BufferGeometry } from "three";
import { toCreasedNormals } from "three/examples/jsm/utils/BufferGeometryUtils.js";

const CREASE = (35 * Math.PI) / 180; // sharper edges stay sharp
const FINE = 1e4; // three takes vertices for one that are within a hundredth

export function geometryOf(buffer) {
  const [vertices, triangles] = new Uint32Array(buffer, 0, 2);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(buffer, 8, 3 * vertices), 3));
  geometry.setIndex(new BufferAttribute(new Uint32Array(buffer, 8 + 12 * vertices, 3 * triangles), 1));
  return toCreasedNormals(geometry.scale(FINE, FINE, FINE), CREASE).scale(1 / FINE, 1 / FINE, 1 / FINE);
}
