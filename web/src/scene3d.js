// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The robot in space: camera, light and floor; drawn only when something has changed.

import {
  Box3, DirectionalLight, Fog, GridHelper, Group, HemisphereLight, Mesh, MeshBasicMaterial, PCFShadowMap, PerspectiveCamera, PlaneGeometry,
  Raycaster, Scene, ShadowMaterial, SphereGeometry, Vector2, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { CSS2DRenderer } from "three/examples/jsm/renderers/CSS2DRenderer.js";
import { resized } from "./dom.js";
import { Marks } from "./marks.js";
import { Robot } from "./robot.js";

const SLOW = 60; // [ms] between two pictures, from which on less is drawn
const MAX_PAUSE = 200; // [ms]
export const VIEWS = { iso: [1, -1.25, 0.55], front: [1, 0, 0], side: [0, -1, 0], top: [0, -1e-3, 1] }; // from the robot to the camera
const [HEAD, FOOT] = [4, 8]; // [rem] above it, for words, and below it, for the legend of colours
const NARROW = 64; // [rem] of a picture in which this legend is below the robot, not beside it
const MAX_CELLS = 120; // of the floor, along a side
const GROWTH_PERIOD = 500; // [ms] between two checks whether the robot has left the picture

export class Scene3D {
  constructor(box, { load, changed }) {
    Object.assign(this, { box, load, changed, dirty: true });
    this.last = this.pause = this.looked = this.mean = 0; // [ms]
    this.renderer = new WebGLRenderer({ antialias: true, alpha: true, powerPreference: "low-power" });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.canvas = this.renderer.domElement;
    this.canvas.tabIndex = -1;
    this.labels = new CSS2DRenderer();
    this.labels.domElement.className = "labels";
    box.prepend(this.canvas, this.labels.domElement);
    this.camera = new PerspectiveCamera(32, 1, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.from = new Vector3(...VIEWS.iso).normalize();
    for (const [event, held] of [["start", true], ["end", false]]) this.controls.addEventListener(event, () => (this.held = held));
    this.controls.addEventListener("change", () => {
      this.framed ||= this.held; // a click moves nothing
      this.dirty = true;
    });
    this.sky = new HemisphereLight(0xffffff, 0x8a8f98, 1.7);
    const [sun, fill] = [new DirectionalLight(0xffffff, 2.2), new DirectionalLight(0xffffff, 0.5)];
    sun.castShadow = true;
    sun.shadow.mapSize.set(1024, 1024);
    [sun.shadow.radius, sun.shadow.bias] = [6, -5e-4];
    sun.position.set(1.2, -1.0, 3.2);
    fill.position.set(-2, 1.5, 0.5);
    this.sun = sun;
    this.lights = new Group().add(sun, sun.target, fill); // in units of the robot's size, about its centre
    this.grid = new GridHelper(2, 2);
    this.grid.material.vertexColors = false;
    this.grid.rotation.x = Math.PI / 2;
    this.ground = new Mesh(new PlaneGeometry(MAX_CELLS, MAX_CELLS), new ShadowMaterial({ opacity: 0.2, fog: true }));
    this.ground.receiveShadow = true;
    this.marks = new Marks();
    this.force = new Marks(true);
    // The worst point of contact: a ball with a rim, seen through the robot.
    const [ball, seen] = [new SphereGeometry(1, 24, 16), { transparent: true, depthTest: false, fog: false }];
    [this.point, this.rim] = [new Mesh(ball, new MeshBasicMaterial(seen)), new Mesh(ball, new MeshBasicMaterial(seen))];
    this.rim.scale.setScalar(1.3);
    [this.rim.renderOrder, this.point.renderOrder, this.point.visible] = [2, 3, false];
    this.point.add(this.rim);
    this.others = new Group(); // robots beside the chosen one
    this.scene = new Scene().add(this.sky, this.lights, this.grid, this.ground, this.marks, this.force, this.point, this.others);
    this.scene.fog = new Fog(0);
    this.ray = new Raycaster();
    resized(box, () => this.#resize());
    this.#resize();
  }

  setTheme({ colours, dark }) {
    this.scene.fog.color.set(colours.view || colours.page);
    this.sky.intensity = dark ? 2.1 : 2.0;
    this.marks.paint(colours.accent, colours.warn);
    this.force.paint(colours.bad, colours.bad);
    [this.panel, this.bad] = [colours.panel, colours.bad];
    this.rim.material.color.set(colours.text);
    this.grid.material.color.set(colours.grid3d || colours.line);
    this.dirty = true;
  }

  setLayout(layout) {
    if (this.robot) {
      this.scene.remove(this.robot);
      this.robot.dispose();
    }
    Object.assign(this, { layout, framed: this.framed && this.others.children.length > 0, posed: false, root: null, followed: null });
    this.showContact(null);
    this.robot = new Robot(layout, this.load, () => {
      if (!this.robot.pending) {
        this.frame(!this.framed);
        this.changed();
      }
      this.dirty = true;
    });
    this.scene.add(this.robot);
    this.marks.forget();
    this.force.forget();
    this.frame(!this.framed);
  }

  place(data, base) {
    const placements = this.layout.placements(data, base);
    if (!placements) return;
    this.robot.place(placements);
    const first = !this.posed;
    this.posed = true;
    if (first && !this.framed) this.frame();
    this.#follow();
    this.#ball();
    this.#grow();
    this.dirty = true;
  }

  // Takes all that links have reached into the picture, until somebody chooses what is in it.
  #grow() {
    const now = performance.now();
    if (this.framed || this.followed || now - this.looked < GROWTH_PERIOD) return;
    this.looked = now;
    const reached = this.reached.clone();
    for (const link of this.robots.flatMap(({ children }) => children)) if (link.children.length) reached.expandByPoint(originOf(link));
    if (!this.reached.equals(reached)) this.#fit(reached, true);
  }

  get robots() {
    return [...(this.robot ? [this.robot] : []), ...this.others.children];
  }

  // Other robots came, left or were moved.
  rearranged() {
    this.root = null;
    if (this.robot) this.frame(!this.framed);
  }

  // Shows the whole robot, from now on at every size of the window; view: of VIEWS, else the direction stays.
  fit(view) {
    this.from.copy(view ? new Vector3(...VIEWS[view]) : this.camera.position.clone().sub(this.controls.target)).normalize();
    this.framed = false;
    this.frame(true, view ? this.reached : new Box3()); // another view of the same motion
  }

  // The camera as text: a name of VIEWS while the robot is fitted, else position and target, six numbers.
  get pose() {
    const view = Object.keys(VIEWS).find((name) => this.from.angleTo(new Vector3(...VIEWS[name])) < 1e-3);
    return !this.framed && view ? view : [...this.camera.position, ...this.controls.target].map((x) => Number(x.toFixed(3))).join();
  }

  // Returns whether the text is one.
  setPose(text) {
    if (Object.hasOwn(VIEWS, text)) this.fit(text);
    const numbers = text.split(",").map(Number);
    if (numbers.length !== 6 || !numbers.every(Number.isFinite)) return Object.hasOwn(VIEWS, text);
    this.camera.position.fromArray(numbers);
    this.controls.target.fromArray(numbers, 3);
    this.framed = true;
    this.controls.update();
    return true;
  }

  // Keeps the target of the camera at a link; null ends it.
  follow(link) {
    Object.assign(this, { followed: link, end: null });
    if (link && this.posed) this.#follow();
    this.dirty = true;
  }

  // Camera and floor by the box around the robot; the floor at its lowest point.
  frame(camera = true, reached = new Box3()) {
    const bounds = this.robots.reduce((box, robot) => box.union(robot.bounds), reached.clone());
    if (bounds.isEmpty() || bounds.min.equals(bounds.max)) bounds.set(new Vector3(-0.5, -0.5, 0), new Vector3(0.5, 0.5, 1));
    this.#fit(bounds, camera);
  }

  #fit(bounds, camera) {
    this.reached = bounds;
    this.centre = bounds.getCenter(new Vector3());
    this.size = halfDiagonal(bounds);
    this.own = this.others.children.length ? halfDiagonal(this.robot.bounds) : this.size; // of the chosen robot
    if (camera) {
      const distance = this.#distance(bounds);
      this.camera.position.copy(this.centre).addScaledVector(this.from, distance);
      [this.camera.near, this.camera.far] = [distance / 100, distance * 30];
      this.camera.updateProjectionMatrix();
      this.controls.target.copy(this.centre);
      [this.controls.minDistance, this.controls.maxDistance] = [0.1 * this.size, 12 * distance];
      this.controls.update();
      this.end = null;
    }
    this.#floor();
    this.dirty = true;
  }

  // From where all corners of the box are seen, with some room around.
  #distance(bounds) {
    const across = Math.tan((0.5 * this.camera.fov * Math.PI) / 180);
    const right = new Vector3().crossVectors(this.camera.up, this.from).normalize();
    const up = new Vector3().crossVectors(this.from, right);
    const distances = cornersOf(bounds).map((place) => {
      const corner = place.sub(this.centre);
      const wide = Math.max(Math.abs(corner.dot(up)) / this.free, Math.abs(corner.dot(right)) / this.camera.aspect);
      return wide / across + corner.dot(this.from);
    });
    return Math.max(0.5 * this.size, ...distances);
  }

  #floor() {
    const { size, centre, reached, sun } = this;
    const decade = 10 ** Math.floor(Math.log10(size));
    const cell = decade * (size / decade >= 4 ? 1 : 0.5);
    this.grid.geometry.dispose();
    const cells = 2 * Math.ceil((6 * size) / cell); // lines that begin far behind the camera are not drawn
    this.grid.geometry = new GridHelper(cells, cells).geometry;
    for (const [part, depth] of [[this.grid, 1e-3], [this.ground, 2e-3]]) {
      part.scale.setScalar(cell);
      part.position.set(Math.round(centre.x / cell) * cell, Math.round(centre.y / cell) * cell, reached.min.z - depth * size);
    }
    [this.scene.fog.near, this.scene.fog.far] = [4 * size, 9.5 * size];
    this.lights.position.copy(centre);
    this.lights.scale.setScalar(size);
    const wide = 1.6 * size;
    Object.assign(sun.shadow.camera, { left: -wide, right: wide, bottom: -wide, top: wide, near: 0.1 * size, far: 8 * size });
    sun.shadow.camera.updateProjectionMatrix();
    sun.shadow.normalBias = 0.004 * size;
  }

  // A robot that drives away takes floor and camera along; a link that is followed, the camera.
  #follow() {
    const at = originOf(this.#root());
    this.root ??= at;
    if (at.distanceTo(this.root) > 0.3 * this.size) {
      const moved = at.clone().sub(this.root).setZ(0);
      this.centre.add(moved);
      this.reached.translate(moved);
      if (!this.followed) this.#shift(moved);
      this.root = at;
      this.#floor();
    }
    const link = this.robot.byName.get(this.followed);
    if (!link) return;
    const end = originOf(link);
    this.#shift(end.clone().sub(this.end ?? this.controls.target));
    this.end = end;
  }

  #shift(moved) {
    for (const place of [this.camera.position, this.controls.target]) place.add(moved);
  }

  #root() {
    return this.robot.byName.get(this.layout.links[0]);
  }

  // root: of the mobility, 3×3 [m/s]; velocity of the link's origin [m/s]; null hides both.
  mark(link, root, velocity) {
    const group = this.robot?.byName.get(link);
    const visible = Boolean(group && root);
    this.dirty ||= visible || this.marks.visible;
    this.marks.visible = visible;
    if (visible) this.marks.place(originOf(group), root, velocity, this.own);
  }

  // The force at the centre of mass of the touched link, see touchAt; null hides it.
  showForce(touch) {
    const group = this.robot?.byName.get(touch?.links[0]);
    const visible = Boolean(group) && Number.isFinite(touch.force[0]);
    this.dirty ||= visible || this.force.visible;
    this.force.visible = visible;
    if (visible) this.force.place(new Vector3(...this.layout.centerOf(touch.links[0])).applyMatrix4(group.matrixWorld), null, touch.force, this.own);
  }

  // The contact point with the smallest margin; null hides it.
  showContact(worst) {
    this.dirty ||= Boolean(worst) || this.point.visible;
    this.worst = worst;
    this.point.visible = Boolean(worst);
    if (!worst) return;
    this.point.material.color.set(worst.above ? this.bad : this.panel);
    this.#ball();
  }

  // Its position is in the axes of the root link.
  #ball() {
    if (!this.worst) return;
    this.point.position.set(...this.worst.position).applyMatrix4(this.#root().matrixWorld);
    this.point.scale.setScalar(0.024 * this.own);
  }

  // Link and robot at a place of the canvas [CSS pixels]; both undefined if there is none.
  pick(x, y) {
    this.ray.setFromCamera(new Vector2((2 * x) / this.box.clientWidth - 1, 1 - (2 * y) / this.box.clientHeight), this.camera);
    const [hit] = this.ray.intersectObjects(this.robots, true);
    return { link: hit?.object.parent.name, robot: hit?.object.parent.parent };
  }

  // Links with a corner outside the picture.
  get outside() {
    const isInside = ({ x, y, z }) => Math.max(Math.abs(x), Math.abs(y), Math.abs(z)) <= 1;
    const corners = (link) => cornersOf(new Box3().setFromObject(link)).map((corner) => corner.project(this.camera));
    return this.robots.flatMap(({ children }) => children).filter((link) => link.children.length && !corners(link).every(isInside)).map(({ name }) => name);
  }

  // A place of the page at which a link is seen, or null; name: of another robot.
  where(link, name) {
    const robot = name ? this.others.getObjectByName(name) : this.robot;
    const group = robot?.byName.get(link);
    if (!group?.children.length) return null;
    const [bounds, rect, places] = [new Box3().setFromObject(group), this.canvas.getBoundingClientRect(), [0.5, 0.35, 0.65, 0.2, 0.8]];
    for (const u of places) for (const v of places) for (const w of places) {
      const place = bounds.getSize(new Vector3()).multiply(new Vector3(w, v, u)).add(bounds.min).project(this.camera);
      const [x, y] = [0.5 * (place.x + 1) * rect.width, 0.5 * (1 - place.y) * rect.height];
      const picked = this.pick(x, y);
      if (picked.link === link && picked.robot === robot) return { x: rect.left + x, y: rect.top + y };
    }
    return null;
  }

  // atOnce: for a picture, which what is drawn stays for no longer than until the page is shown anew.
  render(atOnce = false) {
    const now = performance.now();
    if (!atOnce && (!this.dirty || now - this.last < this.pause)) return;
    this.dirty = false;
    this.renderer.render(this.scene, this.camera);
    this.labels.render(this.scene, this.camera);
    if (now - this.last < 1000) this.mean += (Math.min(now - this.last, MAX_PAUSE) - this.mean) / 12;
    this.last = now;
    if (this.mean > SLOW) this.#drawLess();
  }

  // Without a graphics card: first no shadows and coarse pixels, then fewer pictures.
  #drawLess() {
    if (this.renderer.shadowMap.enabled) {
      this.renderer.shadowMap.enabled = this.sun.castShadow = false;
      this.renderer.setPixelRatio(1);
      this.dirty = true;
    } else this.pause = Math.min(MAX_PAUSE, Math.max(this.pause, 1.5 * this.mean));
    this.mean = 0;
  }

  #resize() {
    const [width, height] = [this.box.clientWidth, this.box.clientHeight];
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.labels.setSize(width, height);
    this.camera.aspect = width / height;
    const rem = parseFloat(getComputedStyle(document.documentElement).fontSize);
    const head = Math.min(0.2 * height, HEAD * rem);
    const foot = width < NARROW * rem ? Math.min(0.25 * height, FOOT * rem) : 0;
    this.free = 1 - (head + foot) / height; // fraction of the picture that is left
    this.camera.setViewOffset(width, height, 0, 0.5 * (foot - head), width, height);
    this.camera.updateProjectionMatrix();
    if (this.robot && !this.framed) this.frame();
    this.dirty = true;
    this.pause = 0;
    this.render();
  }
}

function originOf(group) {
  return new Vector3().setFromMatrixPosition(group.matrixWorld);
}

function halfDiagonal(box) {
  return Math.max(0.05, 0.5 * box.getSize(new Vector3()).length());
}

function cornersOf({ min, max }) {
  return [...Array(8).keys()].map((n) => new Vector3(n & 1 ? max.x : min.x, n & 2 ? max.y : min.y, n & 4 ? max.z : min.z));
}
