// What both drawings need: the theme's colours, read once for each change of theme, and a canvas sharp on any screen.

let known = new Map();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { known = new Map(); });

export function css(name) {
  if (!known.has(name)) known.set(name, getComputedStyle(document.documentElement).getPropertyValue(name).trim());
  return known.get(name);
}

// Sets a canvas's size in pixels of the page; gives the screen's pixels for each of them.
export function ready(canvas, width, height) {
  const ratio = window.devicePixelRatio || 1;
  canvas.style.height = `${Math.round(height)}px`;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  return ratio;
}
