// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Cards of a report's results, before the plots.

import { breakable, el } from "./dom.js";
import { number, percent, quantity, span, UNKNOWN } from "./format.js";

// act: go(t) shows a moment, in seconds after the first state.
export function chapters(content, act) {
  const limits = content.summary.contact_limits ? [contactLimits(content, act)] : [];
  return [overall(content, act), ...limits, quality(content), parameters(content)];
}

const card = (id, title, ...children) =>
  el("section", { class: "card words", id }, el("header", {}, el("h2", { text: title })), el("div", { class: "text" }, ...children));
const line = (label, ...value) => el("div", {}, el("dt", {}, ...(typeof label === "string" ? breakable(label) : [label])), el("dd", {}, ...value));
const at = (t, act) => el("button", { class: "link", text: `${t.toFixed(3)} s`, onclick: () => act.go(t) });

const GAIN = "external_torque.gain";

const PEAKS = {
  kinetic_energy: ["K", "J"],
  energy_share: ["share ½ν²", "J"],
  velocity: ["velocity", "rad/s", "m/s"],
  effort: ["joint torque", "N m", "N"],
  external_torque: ["external torque", "N m", "N"],
  residual_norm: ["|r|", "√J/s"],
};

// Unit of a peak: of a joint that turns, or of one that slides.
function unitOf([, turns, slides = turns], { dofs, angular }, dof) {
  return angular?.[dofs.indexOf(dof)] === false ? slides : turns;
}

function overall({ summary, begin, layout }, act) {
  const { balance } = summary;
  const rows = [line("duration", `${span(summary.duration)}, ${summary.states} states`)];
  if (summary.kinetic_energy.mean !== null) rows.push(line("mean K", `${quantity(summary.kinetic_energy.mean, "J")}`));
  for (const [name, { value, at: when, of }] of Object.entries(summary.peaks)) {
    const peak = PEAKS[name] ?? [name, ""];
    const [label, unit] = [peak[0], unitOf(peak, layout, of)];
    rows.push(line(`largest ${label}`, `${quantity(value, unit)} at `, at(when - begin, act), ...(of ? [", ", ...breakable(of)] : [])));
  }
  const shares = Object.entries(summary.kinetic_energy.share).sort((a, b) => b[1] - a[1]).slice(0, 3);
  if (shares.length) rows.push(line("largest shares", shares.map(([name, value]) => `${name} ${quantity(value, "J")}`).join(", ")));
  rows.push(line("variance explained (R²)", summary.explained === null ? UNKNOWN : percent(summary.explained), summary.explained === null ? "" : ` of dK/dt; residual ${quantity(summary.residual_power, "W")} rms`));
  if (summary.explained_with_potential !== null) rows.push(line("with potential energy", percent(summary.explained_with_potential)));
  return card("overall", `${summary.robot}: summary`, el("dl", {}, ...rows), el("p", { text: balance.text ?? "" }));
}

// Whether collisions of a report are known, and what there is to say of their thresholds.
export function collisionNotes({ summary: { observer } }) {
  const known = !observer.missing.length && observer.observed > 0;
  const count = observer.judged.length;
  const texts = known ? [`Thresholds of ${count} alarm${count === 1 ? "" : "s"}; observer gain ${number(observer.gain)}/s.`] : [];
  if (observer.text) texts.push(observer.text);
  if (observer.missing.includes(GAIN) && observer.observed) texts.push(`${GAIN} is not set; this report uses ${number(observer.gain)}/s.`);
  return [known, texts];
}

// Contact limits: how long they were exceeded, and the worst moment.
function contactLimits({ summary, begin }, act) {
  const { contact_limits: contact } = summary;
  const points = Object.entries(contact.above_by_point).sort((a, b) => b[1] - a[1]);
  const { worst } = contact;
  const moments = [];
  if (worst) {
    moments.push(
      line(
        at(worst.at - begin, act),
        ...breakable(worst.point),
        ` at ${percent(worst.usage)} of the speed allowed by ${worst.region}: ${quantity(worst.speed, "m/s")}, ${quantity(worst.reflected_mass, "kg")}, `,
        `${quantity(worst.energy, "J")}, ${quantity(worst.force, "N")}`,
      ),
    );
  }
  const words = `Limits exceeded for ${span(contact.above)} of ${span(contact.of)}. Advisory: rigid bodies, no safety function.`;
  const by = points.map(([name, seconds]) => line(name, span(seconds)));
  return card("limits", "Contact limits", el("p", { text: words }), el("dl", {}, ...by, ...moments));
}

function quality({ summary }) {
  const { quality: q } = summary;
  const rejected = Object.values(summary.rejected).reduce((a, b) => a + b, 0);
  const rows = [
    line("rate", q.rate === null ? UNKNOWN : `${number(q.rate, 4)} Hz, jitter ${span(q.jitter)}`),
    line("gaps", `${q.gaps}, the longest ${span(q.longest_gap)}`),
    line("repeated states", String(q.repeated_states)),
    line("without effort", String(q.without_effort)),
    line("rejected messages", rejected ? Object.entries(summary.rejected).map(([cause, n]) => `${n} ${cause}`).join(", ") : "0"),
  ];
  if (q.velocity_delay !== null) rows.push(line("velocity delay", span(q.velocity_delay)));
  const texts = [...summary.findings.map(({ cause, count, text }) => (cause === "note" ? text : `${cause}${count > 1 ? ` (${count} ×)` : ""}: ${text}`)), ...summary.warnings];
  return card("quality", "Data quality", el("dl", {}, ...rows), el("ul", {}, ...texts.map((text) => el("li", {}, ...breakable(text)))));
}

function parameters({ parameters: all, summary, version }) {
  const rows = (wanted) => wanted.map(({ name, value }) => line(name, ...breakable(value)));
  const [own, usual] = [all.filter((one) => !one.default), all.filter((one) => one.default)];
  return card(
    "parameters",
    "Parameters",
    el("p", {}, ...breakable(`${summary.recording} · diag_dynamics ${version}`)),
    el("dl", {}, ...rows(own)),
    el("details", {}, el("summary", { text: `${usual.length} defaults` }), el("dl", {}, ...rows(usual))),
  );
}
