// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

"use strict";

// Copy buttons of code blocks.
document.addEventListener("DOMContentLoaded", () => {
  for (const block of document.querySelectorAll("div.highlight")) {
    const button = document.createElement("button");
    button.className = "copy";
    button.type = "button";
    button.title = "Copy";
    button.setAttribute("aria-label", "Copy the code");
    button.textContent = "Copy";
    button.addEventListener("click", async () => {
      await copy(block.querySelector("pre").textContent);
      button.textContent = "Copied";
      setTimeout(() => (button.textContent = "Copy"), 1500);
    });
    block.append(button);
  }
});

async function copy(text) {
  if (navigator.clipboard) return navigator.clipboard.writeText(text);
  const area = document.createElement("textarea"); // a page that was opened over http from another machine
  area.value = text;
  document.body.append(area);
  area.select();
  document.execCommand("copy");
  area.remove();
}

// Excerpts of search results where the site is opened as files: a browser fetches no files.
if (location.protocol === "file:" && location.pathname.endsWith("/search.html")) {
  const root = new URL(".", location.href).href;
  const loaded = new Promise((resolve) => {
    const script = document.createElement("script");
    script.src = "_static/excerpts.js";
    script.onload = resolve;
    document.head.append(script);
  });
  window.fetch = async (address) => {
    await loaded;
    const name = decodeURI(new URL(address, location.href).href.slice(root.length));
    return { text: async () => window.PAGES[name] };
  };
}
