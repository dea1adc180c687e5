// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Which cards are shown beside robot and joint table, and how they fill the grid.

const RESULTS = ["overall", "limits", "quality"]; // of a report

export const PRESETS = {
  monitoring: [...RESULTS, "energy", "external", "collisions", "diagnostics"],
  contact: ["limits", "contact-limits", "external", "norm", "collisions", "diagnostics"],
  dynamics: ["energy", "power", "exchange", "torque", "inertia"],
};
export const DEFAULT = "monitoring";
export const CARDS = [...new Set([...Object.values(PRESETS).flat(), "parameters"])];

// The cards of a text such as "contact,power"; null where a name is neither a preset nor a card.
export function cardsOf(text) {
  const names = text.split(",");
  const isKnown = names.every((name) => Object.hasOwn(PRESETS, name) || CARDS.includes(name));
  return isKnown ? [...new Set(names.flatMap((name) => PRESETS[name] ?? [name]))] : null;
}

// The text of some cards: the name of their preset, or the names of the cards.
export function textOf(cards) {
  const key = [...cards].sort().join();
  return Object.keys(PRESETS).find((preset) => [...PRESETS[preset]].sort().join() === key) ?? cards.join();
}

const [MANY, FEW_PLOTS] = [6, 2];

// Columns of the grid, at most so many, and those that each card spans: no row has a hole. kinds: "plot", "table" or "words".
export function gridOf(kinds, most) {
  const columns = kinds.length > MANY ? most : Math.min(2, most);
  const isWide = kinds.filter((kind) => kind === "plot").length <= FEW_PLOTS;
  const widths = { plot: isWide ? columns : 1, table: Math.min(2, columns), words: 1 };
  const spans = kinds.map((kind) => widths[kind]);
  let free = columns;
  spans.forEach((span, k) => {
    free -= span;
    if (free > 0 && free >= (spans[k + 1] ?? Infinity)) return;
    spans[k] += free;
    free = columns;
  });
  return { columns, spans };
}
