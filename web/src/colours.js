// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Colours of joints, the ramp of links, and the theme.

// The first colours are those that the terminal and the plots give to joints.
const PALETTE = [
  "#4e79a7", "#f28e2b", "#59a14f", "#e15759", "#b07aa1", "#76b7b2", "#edc948", "#ff9da7", "#9c755f",
  "#86bcb6", "#d37295", "#8cd17d", "#b6992d", "#499894", "#d4a6c8", "#bab0ac",
];
const GOLDEN = 137.508; // degrees: neighbours differ most

export function jointColour(k) {
  if (k < PALETTE.length) return PALETTE[k];
  const hue = (k * GOLDEN) % 360;
  return hslToHex(hue, 0.5, [0.52, 0.64, 0.42][k % 3]);
}

export const OTHERS = "#8b95a1";

function hslToHex(h, s, l) {
  const a = s * Math.min(l, 1 - l);
  const part = (n) => {
    const k = (n + h / 30) % 12;
    const value = l - a * Math.max(-1, Math.min(k - 3, 9 - k, 1));
    return Math.round(255 * value).toString(16).padStart(2, "0");
  };
  return `#${part(0)}${part(8)}${part(4)}`;
}

// From calm to hot; equal steps look equally far apart.
const STOPS = [
  [0.0, [70, 96, 128]],
  [0.25, [46, 142, 158]],
  [0.5, [116, 186, 118]],
  [0.75, [240, 190, 66]],
  [1.0, [226, 74, 58]],
];
export const NEUTRAL = [150, 156, 164];

// Red, green and blue, 0 to 255, of a part of the scale; of what is unknown, grey.
export function ramp(part) {
  if (!Number.isFinite(part)) return NEUTRAL;
  const x = Math.min(1, Math.max(0, part));
  for (let k = 1; k < STOPS.length; k++) {
    const [[x0, c0], [x1, c1]] = [STOPS[k - 1], STOPS[k]];
    if (x <= x1) return c0.map((c, n) => Math.round(c + ((c1[n] - c) * (x - x0)) / (x1 - x0)));
  }
  return STOPS[STOPS.length - 1][1];
}

export function rampGradient() {
  return `linear-gradient(to right, ${STOPS.map(([x, c]) => `rgb(${c.join(" ")}) ${100 * x}%`).join(", ")})`;
}

export function hex([r, g, b]) {
  return "#" + [r, g, b].map((c) => c.toString(16).padStart(2, "0")).join("");
}

export function faded(colour, alpha) {
  return colour + Math.round(255 * alpha).toString(16).padStart(2, "0");
}

// "auto" follows the system.
export class Theme {
  constructor(changed) {
    this.system = matchMedia("(prefers-color-scheme: dark)");
    this.chosen = stored("diag.theme") ?? "auto";
    this.changed = changed;
    this.system.addEventListener("change", () => this.#apply());
    this.#apply();
  }

  get dark() {
    return this.chosen === "auto" ? this.system.matches : this.chosen === "dark";
  }

  next() {
    this.chosen = this.dark ? "light" : "dark";
    store("diag.theme", this.chosen);
    this.#apply();
  }

  #apply() {
    document.documentElement.dataset.theme = this.dark ? "dark" : "light";
    const style = getComputedStyle(document.documentElement);
    this.colours = Object.fromEntries(
      ["page", "panel", "line", "grid", "text", "dim", "accent", "good", "warn", "bad"].map((name) => [
        name,
        style.getPropertyValue(`--${name}`).trim(),
      ]),
    );
    this.changed?.();
  }
}

// A page from a file may have no storage.
export function stored(key) {
  try {
    return localStorage.getItem(key);
  } catch {
    return null;
  }
}

export function store(key, value) {
  try {
    localStorage.setItem(key, value);
  } catch {
    // as above
  }
}
