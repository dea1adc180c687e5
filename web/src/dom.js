// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// Elements. Text is always text: names come from robots, and nothing of them is ever read as HTML.

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

// Changes the text only where it differs: the browser lays out anew whatever is written.
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

// A name that may be broken after each of its parts.
export function breakable(name) {
  return name.split(/(?<=[_/.-])/).flatMap((part) => [part, el("wbr")]);
}

// A box that scrolls has the class "more" while there is something below what is seen of it: scroll bars may be hidden.
// How high what is in it would be, its style can have as --content.
export function scrolling(box) {
  const look = () => {
    toggle(box, "more", box.scrollHeight - box.clientHeight - box.scrollTop > 2);
    box.style.setProperty("--content", `${[...box.children].reduce((sum, child) => sum + child.offsetHeight, 0)}px`);
  };
  box.addEventListener("scroll", look, { passive: true });
  resized(box, look);
  for (const child of box.children) resized(child, look);
  return box;
}

// Calls when a box has another size; not at once, for what is laid out anew then may change it again.
export function resized(node, act) {
  const observer = new ResizeObserver(() => requestAnimationFrame(act));
  observer.observe(node);
  return observer;
}
