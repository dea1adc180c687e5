// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The robot as three.js has it: a group for each link, in the link's frame, with all that is seen of it.

import {
  Box3, BoxGeometry, BufferAttribute, BufferGeometry, CapsuleGeometry, CylinderGeometry, Group, Matrix4, Mesh,
  MeshStandardMaterial, Quaternion, SphereGeometry, SRGBColorSpace, Vector3,
} from "three";
import { toCreasedNormals } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import { NEUTRAL } from "./colours.js";

const THICK = 0.024; // radius of a bone, in parts of the robot's size

export class Robot extends Group {
  // load: sha => Promise of an ArrayBuffer; changed: called whenever a mesh has come
  constructor(layout, load, changed) {
    super();
    this.layout = layout;
    this.byName = new Map();
    this.meshes = new Map();
    this.failures = []; // of meshes
    this.pending = 0;
    const placements = layout.tree.placements(layout.scene.rest ?? [], 0) ?? [];
    const box = new Box3().setFromPoints(placements.map((placement) => new Vector3(...placement.slice(12, 15))));
    this.size = Math.max(0.05, 0.5 * box.getSize(new Vector3()).length());
    this.bone = THICK * this.size;
    for (const link of layout.scene.links) this.add(this.#link(link, load, changed));
    this.place(placements);
  }

  #link(link, load, changed) {
    const group = new Group();
    group.name = link.name;
    group.matrixAutoUpdate = false;
    group.userData.material = new MeshStandardMaterial({ roughness: 0.62, metalness: 0.08, fog: false });
    this.byName.set(link.name, group);
    this.paint(link.name, NEUTRAL, false);
    for (const visual of link.visuals) {
      if (visual.kind === "mesh") this.#mesh(group, visual, load, changed, link);
      else put(group, primitive(visual), placed(visual.origin));
    }
    if (!link.visuals.length) this.#standIn(group, link);
    return group;
  }

  #mesh(group, { mesh: sha, origin }, load, changed, link) {
    if (!this.meshes.has(sha)) this.meshes.set(sha, load(sha).then(geometryOf));
    this.pending++;
    this.meshes
      .get(sha)
      .then((geometry) => put(group, geometry, placed(origin)))
      .catch((error) => {
        this.failures.push(error.message);
        if (!group.children.length) this.#standIn(group, link);
      })
      .finally(() => {
        this.pending--;
        changed();
      });
  }

  // What stands for a link without shapes: tubes from its origin to its joints, and to a centre of mass beyond them, with a
  // ball at each end, and the ellipsoid of its inertia.
  #standIn(group, { bones = [], ellipsoid }) {
    const centre = ellipsoid ? [3, 7, 11].map((k) => ellipsoid[k]) : [0, 0, 0];
    const reach = Math.max(this.bone, ...bones.map((bone) => Math.hypot(...bone)));
    const ends = Math.hypot(...centre) > reach ? [...bones, centre] : bones;
    if (ends.length) put(group, new SphereGeometry(1.25 * this.bone, 24, 16), new Matrix4());
    for (const bone of ends) {
      const end = new Vector3(...bone);
      const length = end.length();
      const tube = new CylinderGeometry(this.bone, this.bone, length, 20).translate(0, 0.5 * length, 0);
      put(group, tube, new Matrix4().makeRotationFromQuaternion(new Quaternion().setFromUnitVectors(UP, end.normalize())));
    }
    if (ellipsoid) put(group, new SphereGeometry(1, 32, 20), placed(ellipsoid));
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
    material.color.setRGB(...rgb.map((c) => c / 255), SRGBColorSpace);
    material.emissive.copy(material.color).multiplyScalar(0.35).addScalar(0.02).multiplyScalar(chosen ? 1 : 0);
    return true;
  }

  // The box around all shapes; around origins of links, too, while meshes are loaded.
  get bounds() {
    this.updateMatrixWorld(true);
    const box = new Box3().setFromObject(this);
    for (const link of this.children) if (link.children.length || this.pending) box.expandByPoint(new Vector3().setFromMatrixPosition(link.matrixWorld));
    return box;
  }

  // Without others: in the axes of its own, and without a label.
  alone() {
    this.position.set(0, 0, 0);
    this.label?.removeFromParent();
    this.label = null;
  }

  dispose() {
    this.alone();
    this.traverse((node) => {
      node.geometry?.dispose();
      node.material?.dispose();
    });
  }
}

const UP = new Vector3(0, 1, 0); // of three's cylinders

function put(group, geometry, matrix) {
  const mesh = new Mesh(geometry, group.userData.material);
  mesh.matrix.copy(matrix);
  mesh.matrixAutoUpdate = false;
  mesh.castShadow = true;
  group.add(mesh);
}

function placed(rows) {
  return new Matrix4().set(...rows);
}

function primitive({ kind, size }) {
  if (kind === "box") return new BoxGeometry(...size);
  if (kind === "sphere") return new SphereGeometry(size[0], 32, 20);
  const [radius, length] = size;
  const shape = kind === "capsule" ? new CapsuleGeometry(radius, length, 12, 32) : new CylinderGeometry(radius, radius, length, 40);
  return shape.applyMatrix4(new Matrix4().makeRotationX(Math.PI / 2)); // along z, as URDF has them
}

const CREASE = (35 * Math.PI) / 180; // sharper edges stay sharp
const FINE = 1e4; // three takes vertices for one that are within a hundredth

// Meshes as the server sends them: numbers of vertices and triangles (u32), positions (float32), indices (u32).
function geometryOf(buffer) {
  const [vertices, triangles] = new Uint32Array(buffer, 0, 2);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(buffer, 8, 3 * vertices), 3));
  geometry.setIndex(new BufferAttribute(new Uint32Array(buffer, 8 + 12 * vertices, 3 * triangles), 1));
  return toCreasedNormals(geometry.scale(FINE, FINE, FINE), CREASE).scale(1 / FINE, 1 / FINE, 1 / FINE);
}
