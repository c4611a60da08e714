// Drawing a site from above: shapes in plan units, scaled to the canvas's width; machines on the paths that they were
// last said to go. A path is points [x, y, time us]; before its first and after its last a machine stands.

import { cased, crossOut, css, hasFailed, load, ready } from "./paint.js";

const LEAST_FONT = 10;

export class Plan {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.layout = null;
    this.hits = [];
  }

  setLayout(layout) {
    this.layout = layout;
    this.shapes = new Map(layout.plan.shapes.map((one) => [one.id, one]));
    this.resize();
  }

  resize() {
    if (!this.layout) return;
    const { width, height } = this.layout.plan;
    const wide = this.canvas.clientWidth || 600;
    this.scale = Math.min(wide / width, (window.innerHeight * 0.86) / height);
    this.left = (wide - width * this.scale) / 2;
    this.ratio = ready(this.canvas, wide, Math.max(40, height * this.scale));
  }

  x(value) { return this.left + value * this.scale; }
  y(value) { return value * this.scale; }

  // Where a machine is now, in plan units.
  position(machine, nowUs) {
    const path = machine.path;
    if (!path || path.length === 0) return null;
    for (let number = 1; number < path.length; number++) {
      const [x0, y0, from] = path[number - 1];
      const [x1, y1, until] = path[number];
      if (nowUs < until) {
        const share = Math.max(0, Math.min(1, (nowUs - from) / Math.max(1, until - from)));
        return { x: x0 + (x1 - x0) * share, y: y0 + (y1 - y0) * share };
      }
    }
    const [x, y] = path.at(-1);
    return { x, y };
  }

  draw(snapshot, nowUs, chosen) {
    if (!this.layout || !snapshot) return;
    const pen = this.context;
    pen.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    pen.clearRect(0, 0, this.canvas.width, this.canvas.height);
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    this.hits = [];
    this.ways = [];
    const marks = snapshot.marks ?? {};
    for (const one of this.layout.plan.shapes) this.drawShape(pen, one, marks[one.id] ?? {});
    const bodies = this.layout.machines.filter((one) => snapshot.machines[one.node].path && !this.shapes.has(`m${one.node}`));
    for (const one of bodies) this.drawAhead(pen, snapshot.machines[one.node], one, nowUs, chosen);
    for (const one of this.layout.plan.shapes) this.drawLabel(pen, one, marks[one.id] ?? {});
    for (const thing of snapshot.things ?? []) this.drawThing(pen, thing);
    for (const one of bodies) this.drawBody(pen, one, snapshot.machines[one.node], nowUs, chosen);
    this.crossStanding(pen, snapshot, bodies);
    // For whoever asks what is drawn where, such as a test.
    this.canvas.drawn = this.hits;
    this.canvas.ways = this.ways;
  }

  line(pen, points) {
    pen.beginPath();
    points.forEach(([x, y], number) => (number ? pen.lineTo(this.x(x), this.y(y)) : pen.moveTo(this.x(x), this.y(y))));
    pen.stroke();
  }

  box(one) {
    const [[x0, y0], [x1, y1]] = one.points;
    return { x: this.x(x0), y: this.y(y0), w: (x1 - x0) * this.scale, h: (y1 - y0) * this.scale };
  }

  drawShape(pen, one, mark) {
    pen.setLineDash([]);
    pen.lineWidth = 1;
    if (one.kind === "lane" || one.kind === "edge" || one.kind === "link") {
      pen.lineCap = "round";
      const wide = Math.max(4, (one.kind === "lane" ? 15 : one.kind === "edge" ? 11 : 6) * this.scale);
      for (const [colour, more] of [["--line", 2], ["--free", 0]]) {
        pen.strokeStyle = css(colour);
        pen.lineWidth = wide + more;
        this.line(pen, one.points);
      }
      if (mark.state === "held") this.band(pen, one.points);
      if (mark.state === "blocked") {
        pen.strokeStyle = css("--bad");
        pen.setLineDash([3, 7]);
        pen.lineWidth = Math.max(4, 9 * this.scale);
        this.line(pen, one.points);
        pen.setLineDash([]);
      }
      if (one.kind === "lane") this.arrow(pen, one.points);
      pen.lineCap = "butt";
    } else if (one.kind === "point") {
      pen.fillStyle = css("--dim");
      pen.beginPath();
      pen.arc(this.x(one.points[0][0]), this.y(one.points[0][1]), Math.max(1.5, 4 * this.scale), 0, 7);
      pen.fill();
    } else if (one.kind === "node") {
      pen.fillStyle = css("--card");
      pen.strokeStyle = css("--dim");
      pen.lineWidth = 2;
      pen.beginPath();
      pen.arc(this.x(one.points[0][0]), this.y(one.points[0][1]), Math.max(9, 26 * this.scale), 0, 7);
      pen.fill();
      pen.stroke();
    } else {
      const box = this.box(one);
      if (one.kind === "cell") {
        pen.fillStyle = css("--free");
        pen.strokeStyle = css("--line");
        pen.fillRect(box.x, box.y, box.w, box.h);
        return pen.strokeRect(box.x, box.y, box.w, box.h);
      }
      pen.strokeStyle = css(one.kind === "station" || one.kind === "endpoint" ? "--bay" : one.kind === "card" ? "--dim" : "--line");
      pen.fillStyle = css(one.kind === "obstacle" ? "--line" : one.kind === "station" || one.kind === "card" ? "--card" : "--ground");
      pen.fillRect(box.x, box.y, box.w, box.h);
      pen.strokeRect(box.x, box.y, box.w, box.h);
      if (one.kind === "card") this.drawCard(pen, one, box, mark);
    }
    pen.lineWidth = 1;
  }

  // Held by a right: a band beside the colour alone, so that it can be told from what is free without colours.
  band(pen, points) {
    pen.strokeStyle = css("--hold");
    pen.lineWidth = Math.max(3, 7 * this.scale);
    this.line(pen, points);
  }

  arrow(pen, points) {
    const middle = Math.floor(points.length / 2);
    const [x0, y0] = points[Math.max(0, middle - 1)];
    const [x1, y1] = points[middle];
    const angle = Math.atan2(y1 - y0, x1 - x0);
    const size = Math.max(5, 11 * this.scale);
    pen.fillStyle = css("--dim");
    pen.save();
    pen.translate(this.x(x1), this.y(y1));
    pen.rotate(angle);
    pen.beginPath();
    pen.moveTo(size, 0);
    pen.lineTo(-size * 0.6, -size * 0.6);
    pen.lineTo(-size * 0.6, size * 0.6);
    pen.fill();
    pen.restore();
  }

  font(units, weight = 500) {
    const size = Math.max(LEAST_FONT, units * this.scale);
    this.context.font = `${weight} ${size}px system-ui, sans-serif`;
    return size;
  }

  drawLabel(pen, one, mark) {
    const size = this.font(one.kind === "node" || one.kind === "area" ? 17 : 15);
    pen.fillStyle = css(one.kind === "edge" ? "--dim" : "--ink");
    if (one.kind === "node") {
      const [x, y] = one.points[0];
      const radius = Math.max(9, 26 * this.scale);
      pen.fillText(one.name, this.x(x), this.y(y) - radius - size * 0.6);
      this.hits.push({ x: this.x(x) - radius, y: this.y(y) - radius, w: 2 * radius, h: 2 * radius, what: "shape", id: one.id });
    } else if (one.kind === "lane" || one.kind === "edge") {
      const points = one.points;
      const [x0, y0] = points[Math.floor((points.length - 1) / 2)];
      const [x1, y1] = points[Math.ceil((points.length - 1) / 2)];
      const across = Math.atan2(points.at(-1)[1] - points[0][1], points.at(-1)[0] - points[0][0]) + Math.PI / 2;
      const x = this.x((x0 + x1) / 2);
      const y = this.y((y0 + y1) / 2);
      pen.fillText(one.name, x + Math.cos(across) * size * 1.5, y + Math.sin(across) * size * 1.2);
      this.hits.push({ x: x - 14, y: y - 14, w: 28, h: 28, what: "shape", id: one.id });
    } else if (one.kind === "cell" || one.kind === "endpoint") {
      this.hits.push({ ...this.box(one), what: "shape", id: one.id });
    } else if (one.kind === "area") {
      const box = this.box(one);
      pen.textAlign = "left";
      pen.fillText(one.name, box.x + 5, box.y + (this.scale < 0.6 ? -size * 0.6 : size * 0.75));
      pen.textAlign = "center";
      this.hits.push({ ...box, what: "shape", id: one.id });
    } else if (one.kind === "station") {
      const box = this.box(one);
      const words = [`${one.name}  ${mark.count ?? 0}/${one.room}`, one.name, ""].find((text) => pen.measureText(text).width < box.w - 2);
      pen.fillText(words, box.x + box.w / 2, box.y + box.h * 0.42);
      pen.fillStyle = css("--car");
      pen.fillRect(box.x, box.y + box.h * 0.78, box.w * Math.min(1, (mark.count ?? 0) / Math.max(1, one.room)), box.h * 0.22);
      this.hits.push({ ...box, what: "shape", id: one.id });
    }
  }

  // A machine that does not drive: its orders as lines, what is worn or made as bars.
  drawCard(pen, one, box, mark) {
    let size = this.font(20, 650);
    let y = box.y + size;
    pen.textAlign = "left";
    pen.fillStyle = css("--ink");
    pen.fillText(one.name, box.x + 8, y);
    size = this.font(15);
    for (const line of mark.lines ?? []) {
      y += size * 1.45;
      pen.fillText(line, box.x + 8, y, box.w - 16);
    }
    for (const [name, share, words] of mark.bars ?? []) {
      y += size * 1.7;
      const left = box.x + box.w * 0.4;
      const wide = box.w * 0.36;
      pen.fillStyle = css("--ink");
      pen.fillText(name, box.x + 8, y, box.w * 0.36);
      pen.fillText(words, left + wide + 8, y, box.w * 0.2);
      pen.fillStyle = css("--free");
      pen.fillRect(left, y - size * 0.4, wide, size * 0.8);
      pen.fillStyle = css(share > 0.9 && name.startsWith("T") ? "--wait" : "--car");
      pen.fillRect(left, y - size * 0.4, wide * Math.max(0, Math.min(1, share)), size * 0.8);
      pen.strokeStyle = css("--line");
      pen.strokeRect(left, y - size * 0.4, wide, size * 0.8);
    }
    pen.textAlign = "center";
    this.hits.push({ ...box, what: "machine", id: one.node });
  }

  drawAhead(pen, told, machine, nowUs, chosen) {
    const strong = chosen === null || chosen === machine.node;
    for (const [id, piece] of told.held ?? []) {
      const one = this.shapes.get(id);
      if (one && piece.length > 1) this.band(pen, piece);
      else if (one?.kind === "node") {
        pen.strokeStyle = css("--hold");
        pen.lineWidth = 4;
        pen.beginPath();
        pen.arc(this.x(one.points[0][0]), this.y(one.points[0][1]), Math.max(9, 26 * this.scale) + 3, 0, 7);
        pen.stroke();
      }
    }
    const here = this.position(told, nowUs);
    if (told.ahead?.length && here) {
      pen.globalAlpha = strong ? 1 : 0.12;
      const way = [[here.x, here.y], ...this.way(told.ahead, here)].map(([x, y]) => [this.x(x), this.y(y)]);
      cased(pen, way, "--plan", Math.max(2, 3.5 * this.scale));
      this.ways.push({ node: machine.node, points: way });
      pen.globalAlpha = 1;
    }
    pen.lineWidth = 1;
  }

  // The way ahead as points: a name is a shape's line; of the first, what is left of it from here.
  way(ahead, here) {
    return ahead.flatMap((one, number) => {
      if (typeof one !== "string") return [one];
      const points = this.shapes.get(one)?.points ?? [];
      return number ? points : points.slice(this.piece(points, here) + 1);
    });
  }

  // The piece of a line that a point is on, or nearest to, by the number of its beginning.
  piece(points, here) {
    const gaps = points.slice(1).map(([x1, y1], number) => {
      const [x0, y0] = points[number];
      const long = (x1 - x0) ** 2 + (y1 - y0) ** 2;
      const share = long ? Math.max(0, Math.min(1, ((here.x - x0) * (x1 - x0) + (here.y - y0) * (y1 - y0)) / long)) : 0;
      return Math.hypot(here.x - x0 - share * (x1 - x0), here.y - y0 - share * (y1 - y0));
    });
    return gaps.lastIndexOf(Math.min(...gaps));
  }

  // Machines that do not drive: a card, or the place that they keep.
  crossStanding(pen, snapshot, bodies) {
    for (const machine of this.layout.machines) {
      if (bodies.includes(machine) || !hasFailed(snapshot.machines[machine.node])) continue;
      const own = this.hits.find((hit) => (hit.what === "machine" && hit.id === machine.node) || hit.id === `m${machine.node}`);
      if (!own) continue;
      crossOut(pen, own);
      own.isCrossed = true;
    }
  }

  drawThing(pen, thing) {
    const size = Math.max(9, 18 * this.scale);
    const [x, y] = [this.x(thing.at[0]), this.y(thing.at[1])];
    pen.lineWidth = 2;
    if (thing.kind === "goal") {
      pen.strokeStyle = css("--bay");
      pen.beginPath();
      pen.arc(x, y, size * 0.8, 0, 7);
      pen.moveTo(x - size * 0.4, y);
      pen.lineTo(x + size * 0.4, y);
      pen.moveTo(x, y - size * 0.4);
      pen.lineTo(x, y + size * 0.4);
      pen.stroke();
    } else {
      pen.fillStyle = css("--car");
      pen.fillRect(x - size / 2, y - size / 2, size, size);
    }
    pen.lineWidth = 1;
    this.font(15);
    pen.fillStyle = css("--ink");
    pen.fillText(thing.name, x + size, y - size * 0.9);
    this.hits.push({ x: x - size, y: y - size, w: 2 * size, h: 2 * size, what: "thing", id: `${thing.kind} ${thing.name}` });
  }

  drawBody(pen, machine, told, nowUs, chosen) {
    const spot = this.position(told, nowUs);
    if (!spot) return;
    const size = this.font(15, 650);
    const wide = Math.max(24, 34 * this.scale, pen.measureText(machine.name).width + 8);
    const high = Math.max(16, 22 * this.scale);
    const box = { x: this.x(spot.x) - wide / 2, y: this.y(spot.y) - high / 2, w: wide, h: high };
    pen.fillStyle = css("--robot");
    pen.fillRect(box.x, box.y, box.w, box.h);
    if (told.car) load(pen, box);
    pen.strokeStyle = css(told.wait ? "--wait" : chosen === machine.node ? "--ink" : "--card");
    pen.lineWidth = told.wait || chosen === machine.node ? 3 : 1.5;
    pen.strokeRect(box.x, box.y, box.w, box.h);
    // Below a cross it can be read.
    pen.fillStyle = css(hasFailed(told) ? "--ink" : "--card");
    pen.fillText(machine.name, box.x + wide / 2, hasFailed(told) ? box.y + high + size * 0.6 : box.y + high / 2 + 0.5);
    if (told.car) {
      pen.fillStyle = css("--ink");
      pen.fillText(told.car, box.x + wide / 2, box.y - size * 0.6);
    }
    if (hasFailed(told)) crossOut(pen, box);
    this.hits.push({ ...box, what: "machine", id: machine.node, name: machine.name, isCrossed: hasFailed(told) });
  }

  hit(x, y) {
    return this.hits.findLast((box) => x >= box.x && x <= box.x + box.w && y >= box.y && y <= box.y + box.h) ?? null;
  }
}
