// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Begins: with the recording that is in this file, or with what the server streams.

import { App } from "./app.js";
import { Live } from "./live.js";
import { Report } from "./report.js";

const errors = [];
let app = null;
function record(text) {
  if (errors.includes(text)) return; // as of each drawing
  errors.push(text);
  if (app) app.health.failure = text;
}
addEventListener("error", (event) => record(String(event.message)));
addEventListener("unhandledrejection", (event) => record(String(event.reason)));

const block = document.getElementById("report");
app = new App(document.body, { report: Boolean(block), errors });
const source = block ? new Report(app, block) : new Live(app);
app.begin(source);
