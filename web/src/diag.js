// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// What tests may look at, and nobody may change: window.diag.

import { shortFields } from "./layout.js";

export function readOnly(app, errors) {
  const diag = {
    get errors() {
      return [...errors];
    },
    get state() {
      const { rows, view, health, source, layout } = app;
      const { level, word, says, notes, worst } = app.verdict();
      return {
        level,
        word,
        says,
        notes: notes.map((note) => note.text),
        worst: worst ? worst.text : null,
        connection: health.connection,
        robot: layout?.json.robot ?? null,
        robots: source?.robots?.map((robot) => robot.name) ?? [],
        namespace: source?.robot ?? null,
        paused: view.paused,
        now: view.now(),
        window: rows.length ? view.window() : null,
        stored: rows.length,
        bytes: rows.bytes,
        first: rows.first,
        last: rows.last,
        frames: source?.frames ?? 0,
        selected: { ...app.chosen },
        ready: Boolean(layout && rows.length && !app.stage.scene?.robot?.pending),
      };
    },
    // Numbers by field as they were last drawn, at state.now.
    get values() {
      const { layout, stage } = app;
      if (!layout || !stage.last) return null;
      const [rows, i] = stage.last;
      const base = rows.base(i);
      const found = { t: rows.time(i) };
      for (const [name, { offset, size }] of layout.fields) found[name] = [...rows.data.subarray(base + offset, base + offset + size)];
      return found;
    },
    // What stands in the legends of plots, and in the table: as text and as numbers.
    get plots() {
      return Object.fromEntries(
        app.cards.plots.map((plot) => [
          plot.spec.id,
          {
            values: Object.fromEntries((plot.lines ?? []).map((line, k) => [line.name, plot.values?.[k]])),
            texts: Object.fromEntries((plot.lines ?? []).map((line, k) => [line.name, plot.cells?.[k].textContent])),
            points: plot.plot?.data?.[0]?.length ?? 0,
          },
        ]),
      );
    },
    get colours() {
      const { stage } = app;
      return { by: stage.colouring, end: stage.end, links: Object.fromEntries(stage.colours) };
    },
    get marks() {
      return app.stage.told ? { ...app.stage.told } : null;
    },
    // Where the worst point of contact is drawn; null where it is not.
    get contact() {
      const { point } = app.stage.scene ?? {};
      return point?.visible ? point.position.toArray() : null;
    },
    get names() {
      return app.layout ? shortFields(app.layout).map(({ name }) => name) : [];
    },
    // [ms] of script for the last step of the strip of time, without what three.js draws.
    get step() {
      return app.cost.step;
    },
    get missing() {
      return app.stage.scene?.robot?.missing ?? 0;
    },
    where: (link) => app.stage.scene?.where(link) ?? null,
    go: (t) => app.view.go(t),
  };
  Object.defineProperty(window, "diag", { value: Object.freeze(diag) });
}
