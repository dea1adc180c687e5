// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// A plot over time by uPlot: a card with a title and a legend, whose numbers are those at the cursor.

import uPlot from "uplot";
import { decadeLabel, linearRange, logRange } from "./axes.js";
import { faded } from "./colours.js";
import { el, resized } from "./dom.js";
import { powerOfTen, tick } from "./format.js";
import { Legend } from "./legend.js";
import { chosenLines, noiseOf, othersLine, thresholdsOf } from "./quantities.js";
import { envelope, largest, stacked } from "./sampling.js";

const MAX_LINES = 9;
const CHOICE_PERIOD = 2000; // [ms] between two choices of lines
const TINY = 1e-20; // smallest value on a logarithmic axis
const LETTERS = 0.86; // [rem] of numbers and units at axes
const [AXIS, DIGIT] = [2.9, 0.55]; // [rem] of an axis, and of a digit

export class Plot {
  // shared: theme, view (see view.js), rows(), selected(); state: of the legend
  constructor(spec, shared, state) {
    this.spec = spec;
    this.shared = shared;
    this.seen = true;
    this.chosenAt = -Infinity;
    this.legend = new Legend(state, spec.lines.map(({ name }) => name), () => this.restyle());
    const units = [["unit", spec.unit], ["unit right", spec.right]].filter(([, unit]) => unit);
    this.box = el("div", { class: "plot" }, ...units.map(([name, text]) => el("span", { class: name, text })));
    this.cursor = el("div", { class: "cursor" });
    this.node = el(
      "section",
      { class: "card", id: `plot-${spec.id}`, title: spec.help },
      el("header", {}, el("h2", { text: spec.title })),
      this.legend.node,
      this.box,
    );
    this.observers = [
      resized(this.box, () => this.#resize()),
      new IntersectionObserver((entries) => {
        this.seen = entries.at(-1).isIntersecting; // several ones come together on a busy machine
        if (this.seen) this.draw();
      }),
    ];
    this.observers[1].observe(this.box);
  }

  remove() {
    this.observers.forEach((observer) => observer.disconnect());
    this.plot?.destroy();
    this.node.remove();
  }

  restyle() {
    this.#forget();
    this.draw();
  }

  draw() {
    const rows = this.shared.rows();
    if (!this.seen || !rows?.length || this.box.clientWidth < 20) return;
    const { view } = this.shared;
    const [t0, t1] = view.window();
    const [i0, i1] = rows.range(t0, t1);
    this.#choose(rows, i0, i1);
    if (!this.plot) this.#build();
    const points = Math.max(50, Math.floor(this.plot.bbox.width / devicePixelRatio / 2));
    const getters = this.getters;
    const sample = this.spec.stacked
      ? stacked(rows, i0, i1, points, getters, this.spec.total)
      : envelope(rows, i0, i1, points, getters);
    this.base = view.base();
    for (let k = 0; k < sample[0].length; k++) sample[0][k] -= this.base;
    this.limits = [t0 - this.base, t1 - this.base];
    this.plot.setData(sample, true);
    if (view.following !== this.following) {
      this.following = view.following;
      this.plot.redraw(false, true); // the last label is "now" while live
    }
    this.place();
  }

  // Of the axis on the left.
  get range() {
    const { min, max } = this.plot?.scales.y ?? {};
    return min === undefined ? null : [min, max];
  }

  // The end of a linear axis.
  #end(name) {
    const { min, max } = this.plot.scales[name];
    return this.spec.log ? NaN : Math.max(Math.abs(min), Math.abs(max));
  }

  // Places the cursor, and writes the numbers at it into the legend.
  place() {
    const rows = this.shared.rows();
    if (!this.plot || !this.seen || !rows.length) return;
    this.#line();
    const base = rows.base(rows.nearest(this.shared.view.shown()));
    this.values = this.lines.map((line) => line.get(rows.data, base) * (line.factor ?? this.spec.factor ?? 1));
    this.legend.setValues(this.values, this.lines.map(({ scale }) => this.#end(scale ?? "y")));
  }

  // By the scale as drawn: uPlot applies a new one later.
  #line() {
    const x = this.plot.valToPos(this.shared.view.shown() - this.base, "x");
    const inside = x >= -1 && x <= this.plot.over.clientWidth + 1;
    this.cursor.hidden = !inside;
    if (inside) this.cursor.style.transform = `translateX(${x}px)`;
  }

  #choose(rows, i0, i1) {
    const now = performance.now();
    const selected = this.shared.selected();
    const due = now - this.chosenAt > CHOICE_PERIOD && !this.shared.view.pointing;
    if (this.lines && !due && selected === this.chosenFor) return;
    this.chosenAt = now;
    this.chosenFor = selected;
    const { spec } = this;
    const sizes = spec.lines.length > MAX_LINES ? largest(rows, i0, i1, spec.lines.map((line) => line.get)) : [];
    const { shown, others } = chosenLines(spec, sizes, MAX_LINES, selected);
    const key = `${shown.join()}|${selected}`;
    if (this.lines && key === this.key) return;
    this.key = key;
    this.lines = shown.map((k) => spec.lines[k]);
    if (others.length && spec.stacked) this.lines.push(othersLine(spec, others));
    this.legend.setLines(this.lines, spec.stacked ? 0 : others.length);
    this.#forget();
  }

  #forget() {
    this.plot?.destroy();
    this.plot = null;
  }

  #build() {
    const { spec } = this;
    const { theme } = this.shared;
    const selected = this.shared.selected();
    const draws = [];
    this.drawn = this.lines.filter((line) => this.legend.isShown(line));
    for (const line of this.drawn) {
      const factor = line.factor ?? spec.factor ?? 1;
      const faint = selected >= 0 && line.dof !== undefined && line.dof !== selected && !spec.stacked;
      const get = (d, b) => {
        const value = line.get(d, b) * factor;
        return spec.log && !(value > TINY) ? NaN : value;
      };
      draws.push({ get, series: this.#series(line, faint) });
    }
    for (const line of this.drawn.filter((line) => line.twin)) {
      const factor = line.factor ?? spec.factor ?? 1;
      const faint = selected >= 0 && line.dof !== selected;
      draws.push({
        get: (d, b) => line.twin(d, b) * factor,
        series: { ...this.#series(line, faint), dash: [3, 4], width: 1, stroke: faded(line.colour, faint ? 0.15 : 0.7) },
      });
    }
    this.getters = draws.map((draw) => draw.get);
    const size = parseFloat(getComputedStyle(document.documentElement).fontSize);
    const font = `${Math.ceil(LETTERS * size)}px ${getComputedStyle(document.body).fontFamily}`;
    const { colours } = theme;
    const axis = { stroke: colours.dim, font, grid: { stroke: colours.grid, width: 1 }, ticks: { show: false }, gap: 4 };
    // A low plot has closer numbers: zero alone is no scale.
    const space = (u, k, low, high, room) => Math.min(2.1 * size, Math.max(size, room / 5));
    const wide = (u, values) => Math.ceil(size * Math.max(AXIS, 0.6 + DIGIT * Math.max(...(values ?? [""]).map((text) => text.length))));
    const range = (scale) => {
      const thresholds = this.drawn.filter((line) => (line.scale ?? "y") === scale).flatMap(thresholdsOf);
      const smallest = noiseOf(this.shared.layout())[scale === "y" ? spec.unit : spec.right];
      return (u, low, high) => linearRange(low, high, spec.stacked, thresholds, smallest);
    };
    const options = {
      ...this.#size(),
      legend: { show: false },
      cursor: { show: false },
      padding: [Math.round((spec.unit ? 1.5 : 0.5) * size), spec.right ? 0 : Math.round(0.9 * size), 0, 0],
      pxAlign: 0,
      scales: {
        x: { time: false, range: () => this.limits ?? [0, 1] },
        y: spec.log ? { distr: 3, range: (u, low, high) => logRange(low, high) } : { range: range("y") },
        ...(spec.right ? { right: { range: range("right") } } : {}),
      },
      axes: [
        {
          ...axis,
          size: Math.round(1.5 * size),
          space: 5 * size,
          splits: (u, k, low, high, step) => this.shared.view.splits(this.base, low, high, step),
          values: (u, splits) => this.shared.view.labels(this.base, splits),
        },
        {
          ...axis,
          size: wide,
          space,
          ...(spec.log ? { filter: (u, splits) => splits, grid: { ...axis.grid, filter: (u, splits) => splits.map((x) => (powerOfTen(x) ? x : null)) } } : {}),
          values: spec.log ? (u, splits) => splits.map(labelOf(u)) : (u, splits) => splits.map((x) => tick(x, splits[1] - splits[0] || 1)),
        },
        ...(spec.right ? [{ ...axis, scale: "right", side: 1, size: wide, grid: { show: false }, space }] : []),
      ],
      series: [{}, ...draws.map((draw) => draw.series)],
      hooks: { draw: [(u) => this.#thresholds(u), () => this.plot && this.#line()] },
    };
    this.plot = new uPlot(options, [[], ...draws.map(() => [])], this.box);
    this.plot.over.append(this.cursor);
    this.shared.point(this);
  }

  #series(line, faint) {
    const { spec } = this;
    return {
      label: line.name,
      scale: line.scale ?? "y",
      stroke: spec.stacked ? this.shared.theme.colours.panel : faded(line.colour, faint ? 0.2 : 1),
      fill: spec.stacked ? line.colour : undefined,
      width: spec.stacked ? 0.6 : (line.width ?? 1.4),
      points: spec.points ? { show: true, size: 3, fill: line.colour, stroke: line.colour } : { show: false },
      spanGaps: false,
    };
  }

  #thresholds(u) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.lineWidth = devicePixelRatio;
    ctx.setLineDash([6 * devicePixelRatio, 4 * devicePixelRatio]);
    for (const line of this.drawn) {
      ctx.strokeStyle = faded(line.colour, 0.55);
      ctx.beginPath();
      for (const y of thresholdsOf(line).map((value) => u.valToPos(value, line.scale ?? "y", true))) {
        ctx.moveTo(bbox.left, y);
        ctx.lineTo(bbox.left + bbox.width, y);
      }
      ctx.stroke();
    }
    ctx.restore();
  }

  #size() {
    return { width: this.box.clientWidth, height: this.box.clientHeight };
  }

  #resize() {
    if (!this.plot) return this.draw();
    const { width, height } = this.#size();
    if (width > 20 && height > 20 && (width !== this.plot.width || height !== this.plot.height)) {
      this.plot.setSize({ width, height });
      this.draw();
    }
  }
}

const LINE = 30; // [px] that a label of a logarithmic axis takes

function labelOf(u) {
  const { min, max } = u.scales.y;
  return decadeLabel([min, max], u.bbox.height / devicePixelRatio / LINE);
}
