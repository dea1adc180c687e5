// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// The states of the time window as CSV, a column for each number of a frame.

import { shortFields } from "./layout.js";

const quoted = (text) => (/[",\n\r]/.test(text) || /^[=+\-@\t]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);

export function csv(layout, rows, [t0, t1]) {
  const columns = shortFields(layout);
  const parts = [["t [s]", ...columns.map(({ name }) => name)].map(quoted).join(",") + "\n"];
  for (let i = rows.indexAt(t0); i < rows.length && rows.time(i) <= t1; i++) {
    if (rows.time(i) < t0) continue;
    const values = columns.map(({ at }) => rows.data[rows.base(i) + at]);
    parts.push(`${rows.time(i)},${values.map((value) => (Number.isFinite(value) ? value : "")).join(",")}\n`);
  }
  return new Blob(parts, { type: "text/csv" });
}
