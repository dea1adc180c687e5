// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The robot as three.js has it: a group for each link, in the link's frame, with all that is seen of it.

import {
  BoxGeometry, CapsuleGeometry, Color, CylinderGeometry, Group, Matrix4, Mesh, MeshStandardMaterial, SphereGeometry, Box3, Vector3, Quaternion,
} from "three";
import { NEUTRAL } from "./colours.js";
import { geometryOf } from "./mesh.js";

const UNKNOWN_MASS = 1e-9; // [kg]: lighter links have no ellipsoid
const THICK = 0.018; // radius of a bone, in parts of the robot's size

export class Robot extends Group {
  // load: sha => Promise of an ArrayBuffer; changed: called whenever a mesh has come
  constructor(layout, load, changed) {
    super();
    this.layout = layout;
    this.byName = new Map();
    this.meshes = new Map();
    this.missing = 0;
    this.bone = THICK * sizeOf(layout.scene);
    this.pending = 0;
    for (const link of layout.scene.links) this.add(this.#link(link, load, changed));
    this.updateMatrixWorld();
  }

  #link(link, load, changed) {
    const group = new Group();
    group.name = link.name;
    group.matrixAutoUpdate = false;
    const material = new MeshStandardMaterial({ color: new Color(...linear(NEUTRAL)), roughness: 0.62, metalness: 0.08, fog: false });
    group.userData.material = material;
    this.byName.set(link.name, group);
    for (const visual of link.visuals) {
      if (visual.kind === "mesh") this.#mesh(group, visual, material, load, changed, link, this.layout);
      else this.#put(group, primitive(visual), visual.origin, material);
    }
    this.#bones(group, link.bones ?? [], material);
    if (link.ellipsoid) this.#inertia(group, link, material);
    return group;
  }

  #mesh(group, visual, material, load, changed, link, layout) {
    const { mesh: sha } = visual;
    if (!this.meshes.has(sha)) this.meshes.set(sha, load(sha).then(geometryOf));
    this.pending++;
    this.meshes
      .get(sha)
      .then((geometry) => this.#put(group, geometry, visual.origin, material))
      .catch(() => {
        this.missing++;
        if (group.children.length) return;
        const joints = layout.scene.joints.filter((joint) => joint.parent === link.name && joint.origin);
        this.#bones(group, joints.map((joint) => joint.origin), material);
        this.#inertia(group, link, material);
      })
      .finally(() => {
        this.pending--;
        changed();
      });
  }

  #put(group, geometry, origin, material) {
    const mesh = new Mesh(geometry, material);
    if (origin) mesh.matrix.set(...origin);
    mesh.matrixAutoUpdate = false;
    mesh.castShadow = true;
    group.add(mesh);
  }

  // Tubes from the link's origin to its joints, and a ball at each end.
  #bones(group, ends, material) {
    if (!ends.length) return;
    this.#put(group, new SphereGeometry(1.25 * this.bone, 24, 16), null, material);
    for (const end of ends) {
      const to = new Vector3(...end);
      const length = to.length();
      if (!(length > 0)) continue;
      const tube = new CylinderGeometry(this.bone, this.bone, length, 20).translate(0, 0.5 * length, 0);
      tube.applyQuaternion(new Quaternion().setFromUnitVectors(UP, to.normalize()));
      this.#put(group, tube, null, material);
    }
  }

  // Where nothing is to be seen of a link, the ellipsoid of equal inertia, within the link's extent.
  #inertia(group, link, material) {
    const inertia = link.inertia;
    const semi = inertia?.drawn ?? inertia?.semi;
    if (!semi || !(inertia.mass > UNKNOWN_MASS) || !semi.every((x) => x > 0 && Number.isFinite(x))) return;
    const mesh = new Mesh(new SphereGeometry(1, 32, 20), material);
    const [x, y, z] = [0, 1, 2].map((k) => new Vector3(...inertia.axes.map((row) => row[k])).multiplyScalar(semi[k]));
    mesh.matrix.makeBasis(x, y, z).setPosition(...inertia.com);
    mesh.matrixAutoUpdate = false;
    mesh.castShadow = true;
    group.add(mesh);
  }

  // placements: of each link, 16 numbers column by column.
  place(placements) {
    placements.forEach((placement, k) => {
      const group = this.byName.get(this.layout.links[k]);
      group.matrix.fromArray(placement);
      group.matrixWorldNeedsUpdate = true;
    });
    this.updateMatrixWorld();
  }

  // Whether anything has changed.
  paint(link, rgb, chosen) {
    const material = this.byName.get(link)?.userData.material;
    const key = `${rgb.join()}${chosen}`;
    if (!material || material.userData.key === key) return false;
    material.userData.key = key;
    material.color.setRGB(...linear(rgb));
    material.emissive.setRGB(...(chosen ? linear(rgb).map((c) => 0.35 * c + 0.02) : [0, 0, 0]));
    return true;
  }

  colour(link) {
    return this.byName.get(link)?.userData.material.color;
  }

  get bounds() {
    this.updateMatrixWorld(true);
    return new Box3().setFromObject(this);
  }

  dispose() {
    this.traverse((node) => {
      node.geometry?.dispose();
      node.material?.dispose();
    });
  }
}

const UP = new Vector3(0, 1, 0); // of three's cylinders

// Half the diagonal of the box around a robot [m].
function sizeOf({ bounds }) {
  return bounds ? Math.max(0.05, 0.5 * Math.hypot(...bounds[1].map((x, k) => x - bounds[0][k]))) : 0.5;
}

export function linear(rgb) {
  const colour = new Color().setRGB(...rgb.map((c) => c / 255), "srgb");
  return [colour.r, colour.g, colour.b];
}

function primitive({ kind, size }) {
  if (kind === "box") return new BoxGeometry(...size);
  if (kind === "sphere") return new SphereGeometry(size[0], 32, 20);
  const [radius, length] = size;
  const shape = kind === "capsule" ? new CapsuleGeometry(radius, length, 12, 32) : new CylinderGeometry(radius, radius, length, 40);
  return shape.applyMatrix4(new Matrix4().makeRotationX(Math.PI / 2)); // along z, as URDF has them
}
