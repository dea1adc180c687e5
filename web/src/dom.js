// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Elements. Text is never read as HTML: names come from robots.

export function el(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (name === "text") node.textContent = value;
    else if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...children);
  return node;
}

// Sets the text if it differs: the browser lays out what is written.
export function say(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

export function toggle(node, name, on) {
  if (node.classList.contains(name) !== on) node.classList.toggle(name, on);
}

export function download(name, blob) {
  const url = URL.createObjectURL(blob);
  el("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

// A name that may be broken after each part.
export function breakable(name) {
  return name.split(/(?<=[_/.-])/).flatMap((part) => [part, el("wbr")]);
}

// Calls when a box has another size, in the next frame: a new layout may change it again.
export function resized(node, act) {
  const observer = new ResizeObserver(() => requestAnimationFrame(act));
  observer.observe(node);
  return observer;
}
