// SPDX-FileCopyrightText: diag_dynamics maintainers
// SPDX-License-Identifier: Apache-2.0

// A picture of what is seen: boxes, canvases and texts of the page, painted where they are.

export async function picture(before) {
  const scale = devicePixelRatio;
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [innerWidth * scale, innerHeight * scale];
  const ctx = canvas.getContext("2d");
  ctx.scale(scale, scale);
  before(); // what is drawn on a canvas of WebGL stays there no longer than this
  paint(ctx, document.body, { left: 0, top: 0, right: innerWidth, bottom: innerHeight });
  return new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
}

function paint(ctx, node, clip) {
  if (node.nodeType === Node.TEXT_NODE) return text(ctx, node);
  if (node.nodeType !== Node.ELEMENT_NODE || node.hidden || node.tagName === "DIALOG") return undefined;
  const rect = node.getBoundingClientRect();
  const style = getComputedStyle(node);
  if (style.display === "none" || style.visibility === "hidden") return undefined;
  if (style.display !== "contents" && (rect.bottom < clip.top || rect.top > clip.bottom || rect.right < clip.left || rect.left > clip.right)) return undefined;
  ctx.save();
  ctx.globalAlpha *= Number(style.opacity);
  box(ctx, rect, style);
  if (node.tagName === "CANVAS") ctx.drawImage(node, rect.left, rect.top, rect.width, rect.height);
  let inner = clip;
  if (style.overflowX !== "visible" || style.overflowY !== "visible") {
    ctx.beginPath();
    ctx.rect(rect.left, rect.top, rect.width, rect.height);
    ctx.clip();
    inner = {
      left: Math.max(clip.left, rect.left),
      top: Math.max(clip.top, rect.top),
      right: Math.min(clip.right, rect.right),
      bottom: Math.min(clip.bottom, rect.bottom),
    };
  }
  if (node.tagName === "SELECT") word(ctx, node.selectedOptions[0]?.textContent ?? "", rect, style);
  else for (const child of node.childNodes) if (isOpen(node, child)) paint(ctx, child, inner);
  ctx.restore();
  return undefined;
}

// What is folded away has its place, but is not seen.
function isOpen(node, child) {
  return node.tagName !== "DETAILS" || node.open || child.tagName === "SUMMARY";
}

function box(ctx, rect, style) {
  const radius = parseFloat(style.borderTopLeftRadius) || 0;
  ctx.beginPath();
  ctx.roundRect(rect.left, rect.top, rect.width, rect.height, Math.min(radius, rect.width / 2, rect.height / 2));
  if (style.backgroundImage.startsWith("linear-gradient(to right")) {
    const gradient = ctx.createLinearGradient(rect.left, 0, rect.right, 0);
    const stops = [...style.backgroundImage.matchAll(/(rgba?\([^)]*\)) ([\d.]+)%/g)];
    stops.forEach(([, colour, part]) => gradient.addColorStop(Number(part) / 100, colour));
    ctx.fillStyle = gradient;
    ctx.fill();
  } else if (!/rgba\(0, 0, 0, 0\)|transparent/.test(style.backgroundColor)) {
    ctx.fillStyle = style.backgroundColor;
    ctx.fill();
  }
  if (parseFloat(style.borderTopWidth) > 0 && style.borderTopStyle !== "none") {
    ctx.strokeStyle = style.borderTopColor;
    ctx.lineWidth = parseFloat(style.borderTopWidth);
    ctx.stroke();
  }
}

function word(ctx, content, rect, style) {
  ctx.font = `${style.fontStyle} ${style.fontWeight} ${style.fontSize} ${style.fontFamily}`;
  ctx.fillStyle = style.color;
  ctx.textBaseline = "middle";
  ctx.fillText(content, rect.left + (parseFloat(style.paddingLeft) || 0), (rect.top + rect.bottom) / 2);
}

// A text may stand in several lines: each of its words is put where it stands.
function text(ctx, node) {
  if (!node.data.trim()) return;
  const style = getComputedStyle(node.parentElement);
  ctx.font = `${style.fontStyle} ${style.fontWeight} ${style.fontSize} ${style.fontFamily}`;
  ctx.fillStyle = style.color;
  ctx.textBaseline = "middle";
  const range = document.createRange();
  for (const match of node.data.matchAll(/\S+/g)) {
    range.setStart(node, match.index);
    range.setEnd(node, match.index + match[0].length);
    const rect = range.getBoundingClientRect();
    if (rect.width) ctx.fillText(match[0], rect.left, (rect.top + rect.bottom) / 2);
  }
}
