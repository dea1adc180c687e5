// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The state of the page as the fragment of its address: #robot=/arm&t=12.5&joint=elbow&cards=contact,power

import { cardsOf } from "./presets.js";

const text = { read: (value) => value || undefined, is: "a name" };
const number = { read: (value) => (value.trim() && Number.isFinite(Number(value)) ? Number(value) : undefined), is: "a number" };
const flag = { read: (value) => (value === "1" ? true : undefined), is: "1" };
const cards = { read: (value) => cardsOf(value) ?? undefined, is: "names of presets or cards with commas between them" };

// What a link may have: t [s] is the moment, window [s] the length of the time window.
const KEYS = { robot: text, joint: text, t: number, window: number, colour: text, camera: text, card: text, cards, all: flag };

// The fragment of a state; keys without a value are left out.
export function toHash(state) {
  const known = Object.keys(KEYS).filter((key) => state[key] || state[key] === 0).filter((key) => String(state[key]));
  const pairs = known.map((key) => [key, state[key] === true ? "1" : String(state[key])]);
  return pairs.length ? `#${new URLSearchParams(pairs)}`.replaceAll("%2F", "/").replaceAll("%2C", ",") : "";
}

// The state of a fragment, and a note for each part that is none.
export function fromHash(hash) {
  const [state, notes] = [{}, []];
  for (const [key, value] of new URLSearchParams(hash.replace(/^#/, ""))) {
    const kind = Object.hasOwn(KEYS, key) ? KEYS[key] : null;
    const read = kind?.read(value);
    if (read !== undefined) state[key] = read;
    else notes.push(kind ? `${key} is '${value}'; expected ${kind.is}` : `'${key}' is unknown; expected ${Object.keys(KEYS).join(", ")}`);
  }
  return { state, notes };
}
