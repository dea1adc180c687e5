// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// An ellipsoid and an arrow in the same scale, J M⁻¹ Jᵀ at a link and its velocity; or a force alone.

import {
  BufferGeometry, ConeGeometry, CylinderGeometry, Group, LineBasicMaterial, LineSegments, Matrix4, Mesh, MeshStandardMaterial,
  Quaternion, SphereGeometry, Vector3,
} from "three";

const UP = new Vector3(0, 1, 0); // of three's cylinders
const SIZE = 0.38; // of the ellipsoid, in parts of the robot's
const [SMALLEST, BIGGEST] = [0.17, 0.7]; // between which the scale stays as it is

export class Marks extends Group {
  constructor(isForce = false) {
    super();
    this.isForce = isForce;
    const glass = { transparent: true, depthWrite: false, fog: false };
    this.ellipsoid = new Mesh(new SphereGeometry(1, 48, 32), new MeshStandardMaterial({ ...glass, opacity: 0.3, roughness: 0.4 }));
    this.rings = new LineSegments(greatCircles(), new LineBasicMaterial({ ...glass, opacity: 0.55 }));
    for (const one of [this.ellipsoid, this.rings]) one.matrixAutoUpdate = false;
    this.solid = new MeshStandardMaterial({ fog: false, roughness: 0.5, transparent: isForce, depthTest: !isForce }); // a force is seen through the robot
    this.arrow = new Group();
    this.shaft = new Mesh(new CylinderGeometry(1, 1, 1, 20), this.solid);
    this.head = new Mesh(new ConeGeometry(1, 1, 24), this.solid);
    this.arrow.add(this.shaft, this.head);
    this.add(this.arrow);
    if (!isForce) this.add(this.ellipsoid, this.rings);
    this.forget();
  }

  forget() {
    this.visible = false;
    this.ratio = 0;
  }

  paint(ellipsoid, arrow) {
    for (const one of [this.ellipsoid, this.rings]) one.material.color.set(ellipsoid);
    this.solid.color.set(arrow);
  }

  // at: the arrow's beginning; root: symmetric, maps the unit sphere to the ellipsoid [m/s], null of a force; size: the robot's [m]. Forces
  // are drawn in the scale of the largest one yet.
  place(at, root, vector, size) {
    const longest = (this.isForce ? Math.hypot(...vector) : Math.hypot(...root.flat())) || 1;
    const drawn = this.ratio * longest;
    const isSmall = drawn <= SMALLEST * size && !this.isForce;
    if (!this.ratio || isSmall || !(drawn < BIGGEST * size)) this.ratio = (SIZE * size) / longest;
    if (root) this.#ellipsoid(at, root, size);
    this.#arrow(at, vector, size);
  }

  #ellipsoid(at, root, size) {
    const columns = root.map((column) => new Vector3(...column).multiplyScalar(this.ratio));
    columns.forEach((column, k) => column.setComponent(k, column.getComponent(k) + 0.004 * size)); // never flat
    const matrix = new Matrix4().makeBasis(...columns).setPosition(at);
    this.ellipsoid.matrix.copy(matrix);
    this.rings.matrix.copy(matrix);
  }

  #arrow(at, vector, size) {
    const length = Math.min(this.ratio * Math.hypot(...vector), 1.5 * size);
    const thick = 0.012 * size;
    this.arrow.visible = length > 2 * thick;
    if (!this.arrow.visible) return;
    const head = Math.min(5 * thick, 0.6 * length);
    this.arrow.position.copy(at);
    this.arrow.quaternion.copy(new Quaternion().setFromUnitVectors(UP, new Vector3(...vector).normalize()));
    this.shaft.scale.set(thick, length - head, thick);
    this.shaft.position.y = 0.5 * (length - head);
    this.head.scale.set(2.4 * thick, head, 2.4 * thick);
    this.head.position.y = length - 0.5 * head;
  }
}

// The three of a unit sphere along its axes.
function greatCircles(pieces = 64) {
  const points = [];
  for (let axis = 0; axis < 3; axis++) {
    for (let k = 0; k < pieces; k++) {
      for (const end of [k, k + 1]) {
        const angle = (2 * Math.PI * end) / pieces;
        const point = [Math.cos(angle), Math.sin(angle), 0];
        points.push(new Vector3(...[0, 1, 2].map((n) => point[(n + axis) % 3])));
      }
    }
  }
  return new BufferGeometry().setFromPoints(points);
}
