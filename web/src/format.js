// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Numbers and times as text.

export const UNKNOWN = "–";

export function number(x, digits = 3) {
  if (x === null || x === undefined || !Number.isFinite(x)) return UNKNOWN;
  if (x === 0) return "0";
  const size = Math.abs(x);
  const text = size >= 1e5 || size < 1e-3 ? x.toExponential(Math.max(0, digits - 2)) : precise(x, size, digits);
  return text.replace(/^-/, "−").replace("e-", "e−").replace("e+", "e");
}

const [STEPS, SMALL_SCALE] = [50, 1e-5];

// A number beside others of a scale (a threshold, the end of an axis): without digits below 1/50 of this scale.
export function measure(x, scale) {
  if (!Number.isFinite(x) || !(scale > 0)) return number(x);
  if (Math.abs(x) >= 1e5) return number(x);
  if (scale < SMALL_SCALE) return Math.abs(x) < scale / STEPS ? "0" : number(x);
  const decimals = Math.max(0, Math.ceil(Math.log10(STEPS / scale) - 1e-9));
  const significant = Math.max(0, 2 - Math.floor(Math.log10(Math.abs(x) || 1)));
  return x.toFixed(Math.min(decimals, significant)).replace(/^-(?=.*[1-9])/, "−").replace(/^-/, "");
}

// The scale of a number: its threshold, or else a tenth of the end of its axis.
export function scaleOf(threshold, end) {
  return threshold > 0 ? threshold : 0.1 * end;
}

// A number with its unit, in one line.
export function quantity(x, unit, digits = 3) {
  return withUnit(number(x, digits), unit);
}

export function withUnit(text, unit) {
  return `${text}\u00a0${unit.replace("/", "/\u2060").replace(" ", "\u00a0")}`;
}

// A coordinate, to a millimetre.
export function metres(x) {
  return Number.isFinite(x) ? x.toFixed(3).replace(/^-(?=.*[1-9])/, "−").replace(/^-/, "") : UNKNOWN;
}

function precise(x, size, digits) {
  const rounded = Number(size.toPrecision(digits)); // 9.997 has as many decimals as 10.0
  const decimals = Math.max(0, digits - 1 - Math.floor(Math.log10(rounded)));
  return x.toFixed(Math.min(decimals, digits + 1));
}

// Name of a status by its node's kind and not by its full name, which all of a robot have in common; of the monitor, none.
export function statusName(name) {
  const [, node, rest] = /^(.*?): (.*)$/s.exec(name) ?? [null, null, name];
  const kind = node?.split("/").at(-1).replace(/^diag_dynamics_?/, "");
  return kind ? `${kind}: ${rest}` : rest;
}

// For axes: as few digits as tell neighbours apart.
export function tick(x, step) {
  if (x === 0) return "0";
  const size = Math.abs(x);
  if (size >= 1e5 || size < 1e-4) return number(x, 3);
  return x.toFixed(decimalsOf(step)).replace(/^-/, "−");
}

// Decimals that tell multiples of a step apart.
export function decimalsOf(step) {
  const decimals = Math.max(0, Math.min(6, -Math.floor(Math.log10(step) + 1e-9)));
  const whole = step * 10 ** decimals;
  return Math.abs(whole - Math.round(whole)) > 1e-6 ? decimals + 1 : decimals; // one more of 2.5
}

const POWERS = ["⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"];

export function powerOfTen(x) {
  const exponent = Math.round(Math.log10(x));
  if (!(Math.abs(Math.log10(x) - exponent) <= 1e-6)) return ""; // NaN of what has no logarithm, too
  if (exponent === 0) return "1";
  if (exponent === 1) return "10";
  return "10" + (exponent < 0 ? "⁻" : "") + [...String(Math.abs(exponent))].map((d) => POWERS[Number(d)]).join("");
}

export function percent(x) {
  return Number.isFinite(x) ? `${number(100 * x, Math.abs(x) < 0.1 ? 2 : 3)} %` : UNKNOWN;
}

const CLOCK = 1e8; // [s]: later stamps are times of day, earlier ones those of a simulation or a recording

export function clock(t) {
  if (!Number.isFinite(t)) return UNKNOWN;
  if (t < CLOCK) return `${t.toFixed(3)} s`;
  const date = new Date(Math.round(1000 * t));
  const digits = (x, count) => String(x).padStart(count, "0");
  const [hours, minutes, seconds] = [date.getHours(), date.getMinutes(), date.getSeconds()].map((x) => digits(x, 2));
  return `${hours}:${minutes}:${seconds}.${digits(date.getMilliseconds(), 3)}`;
}

export function span(seconds) {
  if (!Number.isFinite(seconds)) return UNKNOWN;
  if (seconds < -1e-6) return `−${span(-seconds)}`;
  if (seconds < 1e-6) return "0 ms";
  if (seconds < 1) return `${number(1000 * seconds, 2)} ms`;
  if (seconds < 120) return `${number(seconds, 3)} s`;
  if (seconds < 7200) return `${number(seconds / 60, 3)} min`;
  return `${number(seconds / 3600, 3)} h`;
}

// The beginning of a text that is long.
export function shortened(text, most) {
  return text.length <= most ? text : `${text.slice(0, most - 1).trimEnd()}…`;
}

// Joints' names without what they all begin with, as "panda_", and without "_joint" at the ends of all: shorter, and no less
// clear. What is left of each begins with a word, not with its number.
export function shortNames(all) {
  if (all.length < 2) return [...all];
  const names = all.every((name) => /._joint$/.test(name)) ? all.map((name) => name.replace(/_joint$/, "")) : all;
  let length = 0;
  while (names.every((name) => name.length > length && name[length] === names[0][length])) length++;
  const ends = (at) => Math.max(names[0].lastIndexOf("_", at), names[0].lastIndexOf("/", at)) + 1;
  let cut = length ? ends(length - 1) : 0;
  while (cut > 0 && names.some((name) => !/^[^\d_/]/.test(name.slice(cut)))) cut = cut > 1 ? ends(cut - 2) : 0;
  return cut > 2 ? names.map((name) => name.slice(cut)) : [...names];
}
