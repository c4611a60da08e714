// Drawing the site as an elevation: floors above each other, as far apart as they are high, lifts at the ends, everything
// to the millimetre that the bus tells. Between two words of a machine it moves on at its last speed, never beyond the next segment's middle.

import { cased, crossOut, css, hasFailed, load, nameBeside, ready } from "./paint.js";

// Smaller letters are not read, px; what has no room for them has no name in the picture.
const LEAST_FONT = 7;
// Of machines: what has no room for them has its name beside it.
const LEAST_NAME = 9;

// A sign for each class of places: what one can charge at, or as many of its name's letters as no other class begins with.
export function marksOf(layout) {
  const names = [...new Set(Object.values(layout.classes ?? {}))];
  const plugs = new Set((layout.charging ?? []).map((place) => layout.classes[place]));
  const found = new Map();
  for (const name of names) {
    const others = names.filter((other) => other !== name && !plugs.has(other));
    let long = 1;
    while (long < name.length && others.some((other) => other.startsWith(name.slice(0, long)))) long++;
    found.set(name, plugs.has(name) ? "\u26a1" : name.slice(0, long));
  }
  return found;
}

export class Stage {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.layout = null;
    this.hits = [];
  }

  setLayout(layout) {
    this.layout = layout;
    this.tracks = new Map(layout.tracks.map((track) => [track.number, track]));
    this.alleys = layout.tracks.filter((track) => track.kind === "alley").sort((a, b) => b.number - a.number);
    this.lifts = layout.tracks.filter((track) => track.kind === "lift");
    this.spurs = layout.tracks.filter((track) => track.kind === "spur");
    // Floors lie as their lifts join them: alleys of different lengths need not begin above each other.
    this.shift = (track) => layout.shifts?.[track] ?? 0;
    this.longest = Math.max(1, ...this.alleys.map((alley) => this.shift(alley.number) + alley.length));
    const heights = Object.values(layout.heights_mm ?? {}).sort((a, b) => a - b);
    this.lowest_mm = Math.min(...heights.slice(1).map((height, number) => height - heights[number]), Infinity);
    this.highest_mm = heights.at(-1) ?? 0;
    this.marks = marksOf(layout);
    this.places = new Set(layout.places);
    this.charging = new Set(layout.charging ?? []);
    this.bays = new Map(layout.machines.filter((one) => one.station !== null).map((one) => [one.station, one]));
    const names = [...this.bays.values()].map((one) => one.name);
    this.common = names.length ? [...names[0]].findIndex((letter, at) => names.some((name) => name[at] !== letter)) : 0;
    if (this.common < 0) this.common = names[0].length;
    this.liftMachines = new Map(layout.machines.filter((one) => one.kind === "lift").map((one) => [one.home[0], one]));
    this.resize();
  }

  resize() {
    if (!this.layout) return;
    const width = this.canvas.clientWidth || 600;
    const cell = width / (this.longest + 3.9);
    const rows = 1 + (this.highest_mm ? this.highest_mm / this.lowest_mm : 0);
    const high = Math.max(26, Math.min(cell * 2.4, (window.innerHeight * 0.82) / rows));
    this.cell = cell;
    this.floor = high;
    this.ratio = ready(this.canvas, width, high * rows + 16);
  }

  // Middle of an alley's position, in pixels; index 0 and length + 1 are the platforms.
  at(track, position) {
    const below_mm = this.highest_mm - (this.layout.heights_mm?.[track] ?? 0);
    const down = below_mm ? below_mm / this.lowest_mm : 0;
    return { x: (position + this.shift(track) + 1.7) * this.cell, y: 8 + (down + 0.5) * this.floor };
  }

  liftY(track, position) {
    const joins = this.tracks.get(track).joins;
    const low = Math.max(1, Math.min(joins.length, Math.floor(position)));
    const high = Math.min(joins.length, low + 1);
    const one = this.at(joins[low - 1][0], 0).y;
    const other = this.at(joins[high - 1][0], 0).y;
    return one + (other - one) * Math.max(0, Math.min(1, position - low));
  }

  liftX(track) {
    const [alley, index] = this.tracks.get(track).joins[0];
    return this.at(alley, index === 1 ? 0 : this.tracks.get(alley).length + 1).x;
  }

  // Where a machine is now, in positions of its track: it goes on as it said, as far as its plan's leg goes, or one position.
  position(machine, nowUs) {
    const track = this.tracks.get(machine.track);
    const pitch = track ? track.pitch_mm : 1;
    const told = machine.index + machine.offset_mm / pitch;
    const moved = (machine.speed_mm_s * Math.max(0, nowUs - machine.since_us)) / 1e6 / pitch;
    const leg = machine.plan.find(([number, from, to]) => number === machine.track && (to - from) * moved > 0);
    const most = leg ? Math.abs(leg[2] - told) : 1;
    return told + Math.max(-most, Math.min(most, moved));
  }

  where(node, snapshot, nowUs) {
    const machine = snapshot.machines[node];
    const track = this.tracks.get(machine.track);
    if (!track) return null;
    const position = this.position(machine, nowUs);
    if (track.kind === "lift") return { x: this.liftX(track.number), y: this.liftY(track.number, position) };
    if (track.kind === "spur") {
      const [alley, index] = track.joins[0];
      const spot = this.at(alley, index);
      return { x: spot.x, y: spot.y - this.floor * 0.3 * Math.max(0, Math.min(1, position)) };
    }
    const spot = this.at(track.number, Math.min(position, track.length + 1));
    const lift = this.liftAt(track, machine.index);
    if (lift !== null) {
      const platform = snapshot.machines[this.liftMachines.get(lift).node];
      return { x: spot.x, y: this.liftY(lift, this.position(platform, nowUs)) };
    }
    return spot;
  }

  liftAt(alley, index) {
    if (index >= 1 && index <= alley.length) return null;
    const end = index < 1 ? 1 : alley.length;
    const lift = this.lifts.find((one) => one.joins.some(([track, at]) => track === alley.number && at === end));
    return lift ? lift.number : null;
  }

  draw(snapshot, nowUs, chosen) {
    if (!this.layout || !snapshot) return;
    const { context: pen, ratio } = this;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, this.canvas.width, this.canvas.height);
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    this.hits = [];
    this.ways = [];
    this.drawFloors(pen, snapshot);
    this.drawBlocked(pen, snapshot);
    this.drawAhead(pen, snapshot, nowUs, chosen);
    this.drawShafts(pen, snapshot, nowUs);
    for (const machine of this.layout.machines) {
      if (machine.kind === "robot") this.drawRobot(pen, machine, snapshot, nowUs, chosen);
    }
    const machines = this.hits.filter((hit) => hit.what === "machine"), cars = this.hits.filter((hit) => hit.what === "place" && hit.car);
    nameBeside(pen, machines, cars, this.canvas.width / ratio, this.canvas.height / ratio);
    // For whoever asks what is drawn where, such as a test.
    this.canvas.drawn = this.hits;
    this.canvas.ways = this.ways;
  }

  drawFloors(pen, snapshot) {
    const { cell, floor } = this;
    for (const alley of this.alleys) {
      const left = this.at(alley.number, 1).x - cell / 2;
      const middle = this.at(alley.number, 1).y;
      pen.fillStyle = css("--free");
      pen.fillRect(left, middle - floor * 0.14, cell * alley.length, floor * 0.28);
      pen.strokeStyle = css("--line");
      pen.strokeRect(left, middle - floor * 0.14, cell * alley.length, floor * 0.28);
      pen.fillStyle = css("--dim");
      pen.font = `${Math.min(20, floor * 0.3)}px system-ui`;
      pen.fillText(String(alley.number), cell * 0.45, middle);
      for (let index = 1; index <= alley.length; index++) {
        const spot = this.at(alley.number, index);
        this.hits.push({ x: spot.x - cell / 2, y: middle - floor * 0.14, w: cell, h: floor * 0.28, what: "segment", id: `p(${alley.number},${index})` });
        for (const side of [0, 1]) this.drawStation(pen, snapshot, alley.number, index, side);
      }
    }
    for (const spur of this.spurs) this.dashed(pen, this.spurBox(spur));
  }

  spurBox(spur) {
    const spot = this.at(...spur.joins[0]);
    return { x: spot.x - this.cell * 0.46, y: spot.y - this.floor * 0.44, w: this.cell * 0.92, h: this.floor * 0.26 };
  }

  // Where a robot stands out of the way.
  dashed(pen, box) {
    pen.strokeStyle = css("--dim");
    pen.lineWidth = 1.5;
    pen.setLineDash([4, 3]);
    pen.strokeRect(box.x, box.y, box.w, box.h);
    pen.setLineDash([]);
    pen.lineWidth = 1;
  }

  // A segment that nobody can pass, by somebody's word.
  drawBlocked(pen, snapshot) {
    pen.strokeStyle = css("--bad");
    pen.lineWidth = 2.5;
    for (const [number, index] of snapshot.blocked ?? []) {
      const track = this.tracks.get(number);
      if (!track || track.kind === "lift") continue;
      const box = this.crossBox(track, index);
      pen.beginPath();
      pen.moveTo(box.x, box.y);
      pen.lineTo(box.x + box.w, box.y + box.h);
      pen.moveTo(box.x + box.w, box.y);
      pen.lineTo(box.x, box.y + box.h);
      pen.stroke();
    }
    pen.lineWidth = 1;
  }

  // Where a segment that nobody can pass is crossed out.
  crossBox(track, index) {
    const { cell, floor } = this;
    const spot = track.kind === "alley" ? this.at(track.number, index) : this.at(...track.joins[0]);
    const y = track.kind === "alley" ? spot.y : spot.y - floor * 0.3;
    return { x: spot.x - cell * 0.4, y: y - floor * 0.12, w: cell * 0.8, h: floor * 0.24 };
  }

  // An alley's slot.
  slot(track, index) {
    const spot = this.at(track, index);
    return { x: spot.x - this.cell / 2, y: spot.y - this.floor * 0.14, w: this.cell, h: this.floor * 0.28 };
  }

  stationBox(track, index, side) {
    const { cell, floor } = this;
    const spot = this.at(track, index);
    return { x: spot.x - cell * 0.42, y: spot.y + (side === 1 ? -0.45 : 0.18) * floor, w: cell * 0.84, h: floor * 0.26 };
  }

  drawStation(pen, snapshot, track, index, side) {
    const number = (track << 8) | (side << 7) | index;
    const box = this.stationBox(track, index, side);
    const bay = this.bays.get(number);
    const car = snapshot.cars[number];
    if (bay) {
      this.drawBay(pen, bay, box, car, snapshot.machines[bay.node]);
    } else if (this.places.has(number)) {
      pen.strokeStyle = css("--line");
      if (car) {
        pen.fillStyle = css("--car");
        pen.fillRect(box.x, box.y, box.w, box.h);
      } else {
        pen.strokeRect(box.x, box.y, box.w, box.h);
        const mark = this.marks.get(this.layout.classes?.[number]);
        if (mark) this.text(pen, mark, { x: box.x + box.w / 4, y: box.y + box.h / 4, w: box.w / 2, h: box.h / 2 }, css("--dim"), 6);
      }
    } else {
      return;
    }
    const name = car && !bay ? this.text(pen, this.carName(car), box, css("--card")) : null;
    if (!bay) this.hits.push({ ...box, what: "place", id: number, car, name });
  }

  drawBay(pen, bay, box, car, machine) {
    pen.lineWidth = 2;
    pen.strokeStyle = css("--bay");
    pen.fillStyle = car ? css("--car") : css("--card");
    pen.fillRect(box.x, box.y, box.w, box.h);
    pen.strokeRect(box.x, box.y, box.w, box.h);
    pen.lineWidth = 1;
    const doors = machine.doors;
    if (doors) this.drawDoors(pen, box, bay, doors);
    const use = this.layout.bay_uses?.[bay.node] ?? "both";
    const edge = use === "both" ? 0 : 2 * Math.min(5, box.w / 6, box.h / 6);
    if (edge) this.drawUse(pen, box, bay, use === "entry" ? -1 : 1, car ? css("--card") : css("--bay"));
    // A tall box has the tip below or above the name.
    const aside = box.w > 0.8 * box.h ? edge : 0;
    const within = { ...box, x: box.x + aside, w: box.w - 2 * aside };
    const failed = hasFailed(machine);
    const words = car && !failed ? null : bay.name;
    const write = () => (car ? this.text(pen, this.carName(car), within, css("--card")) : this.text(pen, bay.name, within, css("--bay"), LEAST_NAME));
    const name = failed ? null : write();
    if (failed) crossOut(pen, box);
    this.hits.push({ ...box, what: "machine", id: bay.node, car, name, words, use, isCrossed: failed });
  }

  // Towards the street, from a station's alley.
  aside(track, side) {
    return { x: 0, y: side === 1 ? -1 : 1 };
  }

  // A tip at the street's end of a bay that cars only leave, or only enter.
  drawUse(pen, box, bay, outward, colour) {
    const { x, y } = this.aside(bay.station >> 8, (bay.station >> 7) & 1);
    const size = Math.min(5, box.w / 6, box.h / 6);
    const [dx, dy] = [x * outward * size, y * outward * size];
    // In the corner, beside the name.
    const cx = box.x + (x > 0 || !x ? box.w - 1.8 * size : 1.8 * size);
    const cy = box.y + (y > 0 ? box.h - 2 * size : 2 * size);
    pen.fillStyle = colour;
    pen.beginPath();
    pen.moveTo(cx + dx, cy + dy);
    pen.lineTo(cx - dx - dy, cy - dy + dx);
    pen.lineTo(cx - dx + dy, cy - dy - dx);
    pen.fill();
  }

  drawDoors(pen, box, bay, doors) {
    const inside = box.y < this.at(bay.station >> 8, 1).y ? box.y + box.h : box.y;
    const outside = inside === box.y ? box.y + box.h : box.y;
    this.drawDoor(pen, box, outside, doors.input);
    this.drawDoor(pen, box, inside, doors.output);
    pen.fillStyle = doors.light === "green" ? css("--hold") : css("--bad");
    pen.beginPath();
    pen.arc(box.x + box.w + 4, outside, 3, 0, 7);
    pen.fill();
  }

  drawDoor(pen, box, y, state) {
    pen.strokeStyle = css(state === "locked" || state === "closed" ? "--ink" : "--hold");
    pen.lineWidth = 3;
    pen.beginPath();
    const open = state === "open" ? 0.12 : state === "opening" || state === "closing" ? 0.6 : 1;
    pen.moveTo(box.x, y);
    pen.lineTo(box.x + box.w * open, y);
    pen.stroke();
    pen.lineWidth = 1;
  }

  // Authority as a solid band, the plan as a thin line that goes on to its end.
  drawAhead(pen, snapshot, nowUs, chosen) {
    for (const machine of this.layout.machines) {
      if (machine.kind !== "robot") continue;
      const told = snapshot.machines[machine.node];
      const strong = chosen === null || chosen === machine.node;
      pen.globalAlpha = strong ? 0.5 : 0.12;
      pen.fillStyle = css("--hold");
      for (const [track, index] of told.holds) {
        const row = this.tracks.get(track);
        if (!row || row.kind === "lift") continue;
        const box = row.kind === "spur" ? this.spurSlot(row, index) : this.slot(track, index);
        pen.fillRect(box.x, box.y, box.w, box.h);
        // Its edge in full colour: what is held is told apart from what is free without hues.
        if (!strong) continue;
        pen.globalAlpha = 1;
        pen.strokeStyle = css("--hold");
        pen.lineWidth = 2;
        pen.strokeRect(box.x + 1, box.y + 1, box.w - 2, box.h - 2);
        pen.globalAlpha = 0.5;
      }
      pen.globalAlpha = strong ? 1 : 0.15;
      const way = this.wayOf(told, this.where(machine.node, snapshot, nowUs));
      if (way.length > 1) {
        cased(pen, way, "--plan", Math.max(2.5, this.cell * 0.03));
        this.ways.push({ node: machine.node, points: way });
      }
      pen.globalAlpha = 1;
    }
  }

  spurSlot(spur) {
    return this.spurBox(spur);
  }

  // A plan as corners: along alleys, and up and down in shafts and before spurs; never across.
  wayOf(told, from) {
    if (!from) return [];
    const way = [[from.x, from.y]];
    for (const [track, , last] of told.plan) {
      const row = this.tracks.get(track);
      if (!row) continue;
      const [x, y] = way.at(-1);
      if (row.kind === "lift") {
        way.push([this.liftX(track), y], [this.liftX(track), this.liftY(track, last)]);
      } else {
        const spot = row.kind === "alley" ? this.at(track, last) : this.at(...row.joins[0]);
        // From a platform between floors up or down first, along the alley then.
        way.push([x, spot.y], [spot.x, spot.y]);
        if (row.kind === "spur" && last > 0) way.push([spot.x, spot.y - this.floor * 0.3]);
      }
    }
    return way.filter(([x, y], number) => !number || x !== way[number - 1][0] || y !== way[number - 1][1]);
  }

  drawShafts(pen, snapshot, nowUs) {
    const { cell, floor } = this;
    for (const [track, machine] of this.liftMachines) {
      const x = this.liftX(track);
      const joins = this.tracks.get(track).joins;
      const top = this.at(joins[joins.length - 1][0], 0).y - floor * 0.4;
      const bottom = this.at(joins[0][0], 0).y + floor * 0.4;
      pen.strokeStyle = css("--line");
      pen.strokeRect(x - cell * 0.55, top, cell * 1.1, bottom - top);
      // Where it stops.
      pen.strokeStyle = css("--lift");
      for (const [alley] of joins) pen.strokeRect(x - cell * 0.5, this.at(alley, 0).y - floor * 0.2, cell, floor * 0.4);
      const spot = this.where(machine.node, snapshot, nowUs);
      const box = { x: x - cell * 0.5, y: spot.y - floor * 0.2, w: cell, h: floor * 0.4 };
      pen.strokeStyle = css("--lift");
      pen.lineWidth = 3;
      pen.strokeRect(box.x, box.y, box.w, box.h);
      pen.lineWidth = 1;
      const name = this.text(pen, machine.name, { ...box, y: top, h: floor * 0.2 }, css("--dim"), LEAST_NAME);
      const isCrossed = hasFailed(snapshot.machines[machine.node]);
      if (isCrossed) crossOut(pen, box);
      this.hits.push({ ...box, what: "machine", id: machine.node, name, words: machine.name, isCrossed });
    }
  }

  drawRobot(pen, machine, snapshot, nowUs, chosen) {
    const spot = this.where(machine.node, snapshot, nowUs);
    if (!spot) return;
    const told = snapshot.machines[machine.node];
    const box = this.bodyBox(spot, told.track);
    if (told.shuttle && told.shuttle.mm > 50) this.drawShuttle(pen, told, spot);
    pen.fillStyle = css("--robot");
    pen.fillRect(box.x, box.y, box.w, box.h);
    const within = told.car ? load(pen, box) : box;
    pen.strokeStyle = told.wait ? css("--wait") : chosen === machine.node ? css("--ink") : css("--robot");
    pen.lineWidth = told.wait || chosen === machine.node ? 3 : 2;
    pen.strokeRect(box.x, box.y, box.w, box.h);
    pen.lineWidth = 1;
    // Beside a cross it can be read.
    const name = hasFailed(told) ? null : this.text(pen, machine.name, within, css("--card"), LEAST_NAME);
    if (hasFailed(told)) crossOut(pen, box);
    this.hits.push({ ...box, what: "machine", id: machine.node, name, words: machine.name, isCrossed: hasFailed(told) });
  }

  bodyBox(spot) {
    const { cell, floor } = this;
    return { x: spot.x - cell * 0.46, y: spot.y - floor * 0.13, w: cell * 0.92, h: floor * 0.26 };
  }

  drawShuttle(pen, told, spot) {
    const { cell, floor } = this;
    const out = (told.shuttle.mm / 5400) * floor * 0.3 * (told.shuttle.side === 1 ? -1 : 1);
    pen.fillStyle = css("--robot");
    pen.fillRect(spot.x - cell * 0.12, Math.min(spot.y, spot.y + out), cell * 0.24, Math.abs(out));
  }

  // Who named it, without what the names of all compartments begin with, and its number there: IOC2/17 is 2/17 here. A
  // number alone is a car's only where one compartment names them.
  carName(car) {
    const [who, number] = car.split("/");
    return this.bays.size > 1 ? `${who.slice(this.common)}/${number}` : number;
  }

  // A whole name or none; gives what was written.
  text(pen, words, box, colour, least = LEAST_FONT) {
    const font = (size) => { pen.font = `600 ${size}px system-ui`; };
    const high = box.h * 0.8;
    font(high);
    const size = Math.min(high, (high * 0.94 * box.w) / Math.max(pen.measureText(words).width, box.w * 0.5));
    if (size < least) return null;
    font(size);
    pen.fillStyle = colour;
    pen.fillText(words, box.x + box.w / 2, box.y + box.h / 2 + 0.5);
    return words;
  }

  // What is at a point of the picture, the last drawn first.
  hit(x, y) {
    return this.hits.findLast((box) => x >= box.x && x <= box.x + box.w && y >= box.y && y <= box.y + box.h) ?? null;
  }
}
