// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Builds the page into diag_dynamics/page/static, or into the folder that is given: node build.js [FOLDER].
// What comes out depends on nothing but the sources here and the versions in package-lock.json.
import { build } from "esbuild";
import { copyFile, mkdir, readFile, writeFile } from "node:fs/promises";
import path from "node:path";
import { fileURLToPath } from "node:url";

const here = path.dirname(fileURLToPath(import.meta.url));
const out = path.resolve(process.argv[2] ?? path.join(here, "..", "diag_dynamics", "page", "static"));
const PACKAGES = ["three", "uplot"];

async function licences() {
  const parts = ["page.js and page.css contain these packages.\n"];
  for (const name of PACKAGES) {
    const folder = path.join(here, "node_modules", name);
    const { version, license } = JSON.parse(await readFile(path.join(folder, "package.json"), "utf8"));
    const text = (await readFile(path.join(folder, "LICENSE"), "utf8")).replaceAll("\r\n", "\n").trim();
    parts.push(`${"-".repeat(100)}\n${name} ${version}, ${license}\n\n${text}\n`);
  }
  return parts.join("\n");
}

await mkdir(out, { recursive: true });
await build({
  absWorkingDir: here,
  entryPoints: { page: "src/main.js" },
  outdir: out,
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  charset: "utf8",
  legalComments: "none", // licences.txt has them whole
  banner: { js: "/* three.js and uPlot, MIT: licences.txt */" },
  logLevel: "warning",
});
await build({
  absWorkingDir: here,
  entryPoints: { page: "src/page.css" },
  outdir: out,
  bundle: true,
  minify: true,
  target: "es2022",
  charset: "utf8",
  logLevel: "warning",
});
await copyFile(path.join(here, "src", "index.html"), path.join(out, "index.html"));
await writeFile(path.join(out, "licences.txt"), await licences());
