// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The state of the page for tests, read-only: window.diag.

export function readOnly(app, errors) {
  const diag = {
    get errors() {
      return [...errors];
    },
    get state() {
      const { rows, view, source, layout, stage } = app;
      const { level, word, notes, worst } = app.verdict();
      return {
        level,
        word,
        notes: notes.map((note) => note.text),
        worst: worst ? worst.text : null,
        robot: layout?.json.robot ?? null,
        namespace: source?.robot ?? null,
        paused: view.paused,
        now: view.now(),
        window: rows.length ? view.window() : null,
        first: rows.first,
        last: rows.last,
        ready: Boolean(layout && rows.length && !stage.scene?.robot?.pending),
      };
    },
    // Numbers by field as last drawn.
    get values() {
      const { layout, stage } = app;
      if (!layout || !stage.last) return null;
      const [rows, i] = stage.last;
      const base = rows.base(i);
      const fields = [...layout.fields].map(([name, { offset, size }]) => [name, [...rows.data.subarray(base + offset, base + offset + size)]]);
      return { t: rows.time(i), ...Object.fromEntries(fields) };
    },
    // Numbers in the legends of plots.
    get plots() {
      const values = (plot) => Object.fromEntries((plot.lines ?? []).map((line, k) => [line.name, plot.values?.[k]]));
      return Object.fromEntries(app.cards.plots.map((plot) => [plot.spec.id, { values: values(plot), range: plot.range }]));
    },
    get colours() {
      return { by: app.stage.colouring, links: Object.fromEntries(app.stage.colours) };
    },
    get marks() {
      return app.stage.shown ? { ...app.stage.shown } : null;
    },
    get camera() {
      return app.stage.scene?.pose ?? null;
    },
    get target() {
      return app.stage.scene?.controls.target.toArray() ?? null;
    },
    // Links of which a part is outside the picture.
    get outside() {
      return app.stage.scene?.outside ?? [];
    },
    // Where the worst point of contact is drawn; null where it is not.
    get contact() {
      const { point } = app.stage.scene ?? {};
      return point?.visible ? point.position.toArray() : null;
    },
    // Arrow of the force on the touched link; null where none is drawn.
    get force() {
      const { force } = app.stage.scene ?? {};
      if (!force?.visible) return null;
      const tip = force.ellipsoid.matrix.elements.slice(12, 15);
      return { from: force.arrow.position.toArray(), tip };
    },
    get missing() {
      return app.stage.scene?.robot?.failures.length ?? 0;
    },
    // Of robots beside the chosen one: time of the state drawn, place, colours.
    get others() {
      return [...(app.stage.fleet?.others.values() ?? [])].filter(({ t }) => t).map(({ name, t, old, robot }) => ({
        ...{ name, t, old, place: robot.position.toArray(), pending: robot.pending },
        colours: Object.fromEntries([...robot.byName].map(([link, { userData }]) => [link, `#${userData.material.color.getHexString()}`])),
      }));
    },
    where: (link, robot) => app.stage.scene?.where(link, robot) ?? null,
    go: (t) => app.view.go(t),
  };
  Object.defineProperty(window, "diag", { value: Object.freeze(diag) });
}
