// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The states of the window that is seen, a column for each quantity and joint, and for each point of contact.

import { shortFields } from "./layout.js";

const quoted = (text) => (/[",\n\r]/.test(text) || /^[=+\-@\t]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);

// Of a point of contact, by what its number is called elsewhere.
const CONTACT = { speed: "contact_speed", mass: "contact_mass", energy: "contact_energy", allowed: "contact_allowed_speed", margin: "contact_margin" };

// contact: what was told of it at a time, which on a live page is less often than states come; null where nothing is told.
export function csv(layout, rows, [t0, t1], contact = null) {
  const columns = shortFields(layout);
  const points = (contact?.points ?? []).flatMap(({ name }) => Object.values(CONTACT).map((quantity) => `${quantity}.${name}`));
  const names = ["t [s]", ...columns.map((column) => column.name), ...(contact ? ["contact_t [s]", "contact_worst", ...points] : [])];
  const parts = [names.map(quoted).join(",") + "\n"];
  for (let i = rows.indexAt(t0); i < rows.length && rows.time(i) <= t1; i++) {
    if (rows.time(i) < t0) continue;
    const base = rows.base(i);
    const cells = columns.map(({ at }) => {
      const value = rows.data[base + at];
      return Number.isFinite(value) ? String(value) : "";
    });
    if (contact) cells.push(...ofContact(contact.at(rows.time(i)), points.length));
    parts.push(`${rows.time(i)},${cells.join(",")}\n`);
  }
  return new Blob(parts, { type: "text/csv" });
}

function ofContact(told, width) {
  if (!told) return Array(2 + width).fill("");
  const { t, points, worst } = told;
  const numbers = points.flatMap((point) => Object.keys(CONTACT).map((name) => (point[name] === null ? "" : String(point[name]))));
  return [String(t), quoted(points[worst]?.name ?? ""), ...numbers];
}
