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

// A carried thing within its carrier: a gap of the page's colour keeps the two apart for those who see no hues. Gives the
// box of the thing, on which something can be written.
export function load(pen, box) {
  const edge = Math.max(2, Math.min(box.w, box.h) * 0.12);
  const thing = { x: box.x + edge + 1.5, y: box.y + edge + 1.5, w: box.w - 2 * edge - 3, h: box.h - 2 * edge - 3 };
  pen.fillStyle = css("--card");
  pen.fillRect(box.x + edge, box.y + edge, box.w - 2 * edge, box.h - 2 * edge);
  pen.fillStyle = css("--car");
  pen.fillRect(thing.x, thing.y, thing.w, thing.h);
  return thing;
}

const meets = (one, other) => one.x < other.x + other.w && other.x < one.x + one.w && one.y < other.y + other.h && other.y < one.y + one.h;

// Names of bodies that have none within: beside them on a ground of their own, where they lie on no body, no other name
// and, if there is such a spot, on none of the boxes ``spared``; a body gets its name, and the box of it.
export function nameBeside(pen, bodies, spared, wide, high) {
  const taken = [...bodies];
  const size = 10;
  pen.font = `600 ${size}px system-ui, sans-serif`;
  for (const body of bodies) {
    if (body.name || !body.words) continue;
    const spots = spotsBeside(body, pen.measureText(body.words).width + 4, size + 2);
    const isFree = (spot) => spot.x >= 0 && spot.y >= 0 && spot.x + spot.w <= wide && spot.y + spot.h <= high && !taken.some((other) => meets(spot, other));
    const free = spots.filter(isFree);
    const spot = free.find((one) => !spared.some((other) => meets(one, other))) ?? free[0];
    if (!spot) continue;
    taken.push(spot);
    body.name = body.words;
    body.beside = spot;
    pen.fillStyle = css("--card");
    pen.fillRect(spot.x, spot.y, spot.w, spot.h);
    pen.fillStyle = css("--ink");
    pen.fillText(body.words, spot.x + spot.w / 2, spot.y + spot.h / 2 + 0.5);
  }
}

// Above and below: in the middle, to the right and to the left; then at both sides, and further away.
function spotsBeside(body, w, h) {
  const [right, bottom] = [body.x + body.w, body.y + body.h];
  const columns = [body.x + (body.w - w) / 2, body.x, right - w];
  const spots = [...columns.map((x) => [x, body.y - h - 1]), ...columns.map((x) => [x, bottom + 1])];
  const level = body.y + (body.h - h) / 2;
  const far = columns.flatMap((x) => [[x, body.y - 2 * h - 2], [x, bottom + h + 2]]);
  return [...spots, [right + 1, level], [body.x - w - 1, level], ...far].map(([x, y]) => ({ x, y, w, h }));
}
