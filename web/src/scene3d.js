// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The robot in space: camera, light and floor; drawn only when something has changed.

import {
  Box3, Color, DirectionalLight, Fog, GridHelper, HemisphereLight, Mesh, MeshBasicMaterial, PCFShadowMap, PerspectiveCamera, PlaneGeometry,
  Raycaster, Scene, ShadowMaterial, SphereGeometry, Vector2, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { resized } from "./dom.js";
import { Marks } from "./marks.js";
import { Robot } from "./robot.js";

const SLOW = 60; // [ms] between two pictures, from which on less is drawn
const LONGEST = 200;
const FROM = new Vector3(1, -1.25, 0.55).normalize(); // the camera, as seen from the robot
const ROOM = 0.9; // part of the picture that the robot takes
const HEAD = 4; // [rem] above it, where words stand
const GROWN = 500; // [ms] between two looks whether it has gone out of the picture

export class Scene3D {
  constructor(box, { load, changed }) {
    this.box = box;
    this.load = load;
    this.changed = changed;
    this.dirty = true;
    this.times = [];
    this.last = this.pause = this.looked = 0; // [ms]
    this.renderer = new WebGLRenderer({ antialias: true, alpha: true, powerPreference: "low-power" });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.canvas = this.renderer.domElement;
    this.canvas.tabIndex = -1;
    box.prepend(this.canvas);
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(32, 1, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener("change", () => (this.dirty = true));
    this.controls.addEventListener("start", () => (this.framed = true));
    this.sky = new HemisphereLight(0xffffff, 0x8a8f98, 1.7);
    this.sun = new DirectionalLight(0xffffff, 2.2);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(1024, 1024);
    this.sun.shadow.radius = 6;
    this.fill = new DirectionalLight(0xffffff, 0.5);
    this.scene.add(this.sky, this.sun, this.sun.target, this.fill);
    this.marks = new Marks();
    // The worst point of contact: a ball with a rim, which are seen through the robot and before whatever is behind them.
    const [ball, seen] = [new SphereGeometry(1, 24, 16), { transparent: true, depthTest: false, fog: false }];
    this.point = new Mesh(ball, new MeshBasicMaterial(seen));
    this.rim = new Mesh(ball, new MeshBasicMaterial(seen));
    this.rim.scale.setScalar(1.3);
    [this.rim.renderOrder, this.point.renderOrder] = [2, 3];
    this.point.add(this.rim);
    this.point.visible = false;
    this.scene.add(this.marks, this.point);
    this.ray = new Raycaster();
    resized(box, () => this.#resize());
    this.#resize();
  }

  setTheme({ colours, dark }) {
    this.scene.fog = new Fog(new Color(colours.view || colours.page), 1, 100);
    this.sky.intensity = dark ? 2.1 : 2.0;
    this.marks.paint(colours.accent, colours.warn);
    [this.panel, this.bad] = [colours.panel, colours.bad];
    this.rim.material.color.set(colours.text);
    this.gridColour = colours.grid3d || colours.line;
    if (this.size) this.#floor();
    this.dirty = true;
  }

  setLayout(layout) {
    if (this.robot) {
      this.scene.remove(this.robot);
      this.robot.dispose();
    }
    this.layout = layout;
    this.framed = this.floored = false;
    this.posed = false;
    this.root = null;
    this.touch(null);
    this.robot = new Robot(layout, this.load, () => {
      if (!this.robot.pending) {
        this.frame(!this.framed);
        this.changed();
      }
      this.dirty = true;
    });
    this.scene.add(this.robot);
    this.marks.forget();
    this.frame();
  }

  place(data, base) {
    const placements = this.layout.placements(data, base);
    if (!placements) return;
    this.robot.place(placements);
    if (!this.posed) {
      this.posed = true;
      if (!this.framed) this.frame();
    }
    this.#follow();
    this.#ball();
    this.#grow();
    this.dirty = true;
  }

  // Takes all that links have reached into the picture, until somebody chooses what is in it.
  #grow() {
    const now = performance.now();
    if (this.framed || now - this.looked < GROWN) return;
    this.looked = now;
    const reached = this.reached.clone();
    for (const link of this.robot.byName.values()) {
      if (link.children.length) reached.expandByPoint(new Vector3().setFromMatrixPosition(link.matrixWorld));
    }
    if (!this.reached.equals(reached)) this.#fit(reached, true);
  }

  // Camera and floor by the box around the robot; the floor at its lowest point.
  frame(camera = true) {
    let bounds = this.posed && !this.robot.pending ? this.robot.bounds : new Box3();
    const given = this.layout?.scene.bounds;
    if (bounds.isEmpty() && given) bounds = new Box3(new Vector3(...given[0]), new Vector3(...given[1]));
    if (bounds.isEmpty()) bounds.set(new Vector3(-0.5, -0.5, 0), new Vector3(0.5, 0.5, 1));
    this.#fit(bounds, camera);
  }

  #fit(bounds, camera) {
    this.reached = bounds;
    const centre = bounds.getCenter(new Vector3());
    this.size = Math.max(0.05, 0.5 * bounds.getSize(new Vector3()).length());
    this.lowest = bounds.min.z;
    this.centre = centre.clone();
    if (camera) {
      const distance = this.#distance(bounds, centre);
      this.camera.position.copy(centre).addScaledVector(FROM, distance);
      this.camera.near = distance / 100;
      this.camera.far = distance * 30;
      this.camera.updateProjectionMatrix();
      this.controls.target.copy(centre);
      this.controls.minDistance = 0.1 * this.size;
      this.controls.maxDistance = 12 * distance;
      this.controls.update();
    }
    this.#floor();
    this.dirty = true;
  }

  // From where all corners of the box are seen, with some room around.
  #distance(bounds, centre) {
    const across = Math.tan((0.5 * this.camera.fov * Math.PI) / 180) * ROOM;
    const right = new Vector3().crossVectors(this.camera.up, FROM).normalize();
    const up = new Vector3().crossVectors(FROM, right);
    let distance = 0.5 * this.size;
    for (let n = 0; n < 8; n++) {
      const corner = new Vector3(...["x", "y", "z"].map((axis, k) => ((n >> k) & 1 ? bounds.max : bounds.min)[axis])).sub(centre);
      const wide = Math.max(Math.abs(corner.dot(up)) / this.below, Math.abs(corner.dot(right)) / this.camera.aspect);
      distance = Math.max(distance, wide / across + corner.dot(FROM));
    }
    return distance;
  }

  #floor() {
    for (const old of [this.grid, this.ground]) {
      if (!old) continue;
      this.scene.remove(old);
      old.geometry.dispose();
      old.material.dispose();
    }
    const cell = 10 ** Math.floor(Math.log10(this.size)) * (this.size / 10 ** Math.floor(Math.log10(this.size)) >= 4 ? 1 : 0.5);
    const cells = Math.ceil((12 * this.size) / cell / 2) * 2;
    this.grid = new GridHelper(cells * cell, cells, this.gridColour, this.gridColour);
    this.grid.rotation.x = Math.PI / 2;
    const middle = (x) => Math.round(x / cell) * cell;
    this.grid.position.set(middle(this.centre.x), middle(this.centre.y), this.lowest - 1e-3 * this.size);
    this.ground = new Mesh(new PlaneGeometry(cells * cell, cells * cell), new ShadowMaterial({ opacity: 0.2, fog: true }));
    this.ground.position.set(this.centre.x, this.centre.y, this.lowest - 2e-3 * this.size);
    this.ground.receiveShadow = true;
    this.scene.add(this.grid, this.ground);
    this.scene.fog.near = 4 * this.size;
    this.scene.fog.far = 9.5 * this.size;
    this.sun.position.copy(this.centre).add(new Vector3(1.2, -1.0, 3.2).multiplyScalar(this.size));
    this.sun.target.position.copy(this.centre);
    this.fill.position.copy(this.centre).add(new Vector3(-2, 1.5, 0.5).multiplyScalar(this.size));
    const shadow = this.sun.shadow.camera;
    [shadow.left, shadow.right, shadow.bottom, shadow.top] = [-1.6, 1.6, -1.6, 1.6].map((x) => x * this.size);
    [shadow.near, shadow.far] = [0.1 * this.size, 8 * this.size];
    shadow.updateProjectionMatrix();
    this.sun.shadow.bias = -5e-4;
    this.sun.shadow.normalBias = 0.004 * this.size;
  }

  // A robot that drives away takes the camera along.
  #follow() {
    const root = this.robot.byName.get(this.layout.links[0]);
    if (!root) return;
    const at = new Vector3().setFromMatrixPosition(root.matrixWorld);
    if (this.root && at.distanceTo(this.root) > 0.3 * this.size) {
      const moved = at.clone().sub(this.root).setZ(0);
      this.camera.position.add(moved);
      this.controls.target.add(moved);
      this.centre.add(moved);
      this.reached.translate(moved);
      this.root = at;
      this.#floor();
    }
    this.root ??= at;
  }

  // root: of the mobility, 3×3 [m/s]; velocity of the link's origin [m/s]; null hides both.
  mark(link, root, velocity) {
    const group = this.robot?.byName.get(link);
    const visible = Boolean(group && root);
    this.dirty ||= visible || this.marks.visible;
    this.marks.visible = visible;
    if (visible) this.marks.place(new Vector3().setFromMatrixPosition(group.matrixWorld), root, velocity, this.size);
  }

  // The point at which a touch would be worst: a ball that is seen through the robot; null hides it.
  touch(worst) {
    this.dirty ||= Boolean(worst) || this.point.visible;
    this.worst = worst;
    this.point.visible = Boolean(worst);
    if (!worst) return;
    this.point.material.color.set(worst.above ? this.bad : this.panel);
    this.#ball();
  }

  // Goes with the root link.
  #ball() {
    if (!this.worst) return;
    this.point.position.set(...this.worst.position);
    const root = this.robot?.byName.get(this.layout.links[0]); // in whose axes it is told
    if (root) this.point.position.applyMatrix4(root.matrixWorld);
    this.point.scale.setScalar(0.024 * this.size);
  }

  // The link at a place of the canvas [CSS pixels], or null.
  pick(x, y) {
    if (!this.robot) return null;
    this.#aim(x, y);
    const [hit] = this.ray.intersectObject(this.robot, true);
    for (let node = hit?.object; node; node = node.parent) if (this.robot.byName.has(node.name)) return node.name;
    return null;
  }

  #aim(x, y) {
    const [width, height] = [this.box.clientWidth, this.box.clientHeight];
    this.ray.setFromCamera(new Vector2((2 * x) / width - 1, 1 - (2 * y) / height), this.camera);
  }

  // A place of the page at which a link is seen, or null.
  where(link) {
    const group = this.robot?.byName.get(link);
    if (!group?.children.length) return null;
    const bounds = new Box3().setFromObject(group);
    const rect = this.canvas.getBoundingClientRect();
    const corner = new Vector3();
    for (let n = 0; n < 125; n++) {
      const part = [n % 5, Math.floor(n / 5) % 5, Math.floor(n / 25)].map((k) => [0.5, 0.35, 0.65, 0.2, 0.8][k]);
      corner.copy(bounds.max).sub(bounds.min).multiply(new Vector3(...part)).add(bounds.min).project(this.camera);
      const [x, y] = [0.5 * (corner.x + 1) * rect.width, 0.5 * (1 - corner.y) * rect.height];
      if (this.pick(x, y) === link) return { x: rect.left + x, y: rect.top + y };
    }
    return null;
  }

  get fine() {
    return this.renderer.shadowMap.enabled;
  }

  // atOnce: for a picture, which what is drawn stays for no longer than until the page is shown anew.
  render(atOnce = false) {
    const now = performance.now();
    if (!atOnce && (!this.dirty || now - this.last < this.pause)) return false;
    this.dirty = false;
    this.renderer.render(this.scene, this.camera);
    this.#judge(now);
    return true;
  }

  // Where pictures take long, as without a graphics card: first without shadows and fine pixels, then fewer of them.
  #judge(now) {
    if (now - this.last < 1000) this.times.push(now - this.last);
    this.last = now;
    if (this.times.length < 12) return;
    const middle = this.times.sort((a, b) => a - b)[6];
    this.times = [];
    if (middle < SLOW) return;
    if (this.fine) this.#coarse();
    else this.pause = Math.min(LONGEST, Math.max(this.pause, 1.5 * middle));
  }

  #coarse() {
    this.renderer.shadowMap.enabled = false;
    this.sun.castShadow = false;
    this.renderer.setPixelRatio(1);
    this.dirty = true;
  }

  #resize() {
    const [width, height] = [this.box.clientWidth, this.box.clientHeight];
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    const head = Math.min(0.2 * height, HEAD * parseFloat(getComputedStyle(document.documentElement).fontSize));
    this.below = 1 - head / height; // part of the picture that is left
    this.camera.setViewOffset(width, height, 0, -0.5 * head, width, height);
    this.camera.updateProjectionMatrix();
    if (this.robot && !this.framed) this.frame();
    this.dirty = true;
    this.pause = 0;
    this.render();
  }
}
