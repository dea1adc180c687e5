// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Meshes as the server sends them: numbers of vertices and triangles (u32), positions (float32), indices (u32).

import { BufferAttribute, BufferGeometry } from "three";
import { creased } from "./crease.js";

export function geometryOf(buffer) {
  const view = new DataView(buffer);
  const [vertices, triangles] = [view.getUint32(0, true), view.getUint32(4, true)];
  const positions = new Float32Array(buffer, 8, 3 * vertices);
  const indices = new Uint32Array(buffer, 8 + 12 * vertices, 3 * triangles);
  const { corners, normals } = creased(positions, indices);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(corners, 3));
  geometry.setAttribute("normal", new BufferAttribute(normals, 3));
  return geometry;
}
