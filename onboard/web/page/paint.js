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

// A line of one colour on any ground: dashes over a solid casing in the page's own colour. Where a point is null the line
// has a gap: it goes on at the next.
export function cased(pen, points, colour, width) {
  const stroke = () => {
    pen.beginPath();
    points.forEach((point, number) => {
      if (point) number && points[number - 1] ? pen.lineTo(...point) : pen.moveTo(...point);
    });
    pen.stroke();
  };
  pen.setLineDash([]);
  pen.lineJoin = "round";
  pen.strokeStyle = css("--card");
  pen.lineWidth = width + 3;
  stroke();
  pen.strokeStyle = css(colour);
  pen.lineWidth = width;
  pen.setLineDash([6, 4]);
  stroke();
  pen.setLineDash([]);
  pen.lineWidth = 1;
}

// Whoever is silent or stopped is crossed out.
export const hasFailed = (told) => told.state === "silent" || told.state === "stopped";

export function crossOut(pen, box) {
  for (const [colour, width] of [["--card", 5], ["--bad", 2.5]]) {
    pen.strokeStyle = css(colour);
    pen.lineWidth = width;
    pen.beginPath();
    pen.moveTo(box.x, box.y);
    pen.lineTo(box.x + box.w, box.y + box.h);
    pen.moveTo(box.x + box.w, box.y);
    pen.lineTo(box.x, box.y + box.h);
    pen.stroke();
  }
  pen.lineWidth = 1;
}

// A carried thing within its carrier: a gap of the page's colour keeps the two apart for those who see no hues.
export function load(pen, box) {
  const edge = Math.max(2, Math.min(box.w, box.h) * 0.12);
  pen.fillStyle = css("--card");
  pen.fillRect(box.x + edge, box.y + edge, box.w - 2 * edge, box.h - 2 * edge);
  pen.fillStyle = css("--car");
  pen.fillRect(box.x + edge + 1.5, box.y + edge + 1.5, box.w - 2 * edge - 3, box.h - 2 * edge - 3);
}
