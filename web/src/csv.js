// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The states of the window that is seen, a column for each quantity and joint.

import { shortFields } from "./layout.js";

const quoted = (text) => (/[",\n\r]/.test(text) || /^[=+\-@\t]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);

export function csv(layout, rows, [t0, t1]) {
  const columns = shortFields(layout);
  const parts = [["t [s]", ...columns.map((column) => column.name)].map(quoted).join(",") + "\n"];
  for (let i = rows.indexAt(t0); i < rows.length && rows.time(i) <= t1; i++) {
    if (rows.time(i) < t0) continue;
    const base = rows.base(i);
    const cells = columns.map(({ at }) => {
      const value = rows.data[base + at];
      return Number.isFinite(value) ? String(value) : "";
    });
    parts.push(`${rows.time(i)},${cells.join(",")}\n`);
  }
  return new Blob(parts, { type: "text/csv" });
}
