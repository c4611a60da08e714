// Drawing a building floor by floor from above, to scale: any alleys, lifts anywhere, places beside every slot. The
// scene says in mm where each track's index 1 is and which way its index grows; all else follows from it.

import { Stage } from "./draw.js";
import { crossOut, css, hasFailed, ready } from "./paint.js";

export class Building extends Stage {
  setLayout(layout) {
    this.plan = layout.building;
    super.setLayout(layout);
  }

  resize() {
    if (!this.layout) return;
    const { width, height } = this.plan;
    const wide = this.canvas.clientWidth || 600;
    this.scale = Math.min(wide / width, (window.innerHeight * 0.86) / height);
    // A position along an alley, and across it a place, an alley and a place.
    const pitch = Math.min(...this.alleys.map((alley) => alley.pitch_mm));
    this.cell = pitch * this.scale;
    this.floor = this.cell / 0.28;
    this.ratio = ready(this.canvas, wide, height * this.scale);
  }

  // Middle of a position of an alley or a spur, px; beyond its ends as well.
  at(track, position) {
    const [x, y, dx, dy] = this.plan.lines[track];
    const along = (position - 1) * this.tracks.get(track).pitch_mm;
    return { x: (x + dx * along) * this.scale, y: (y + dy * along) * this.scale };
  }

  heading(track) {
    const [, , dx, dy] = this.plan.lines[track];
    return { dx, dy };
  }

  // A platform at the stop that it is nearest to.
  stopAt(track, position) {
    const stops = this.plan.platforms[track];
    const [x, y] = stops[Math.max(0, Math.min(stops.length - 1, Math.round(position) - 1))];
    return { x: x * this.scale, y: y * this.scale };
  }

  where(node, snapshot, nowUs) {
    const machine = snapshot.machines[node];
    const track = this.tracks.get(machine.track);
    if (!track) return null;
    const position = this.position(machine, nowUs);
    if (track.kind === "lift") return this.stopAt(track.number, position);
    const spot = this.at(track.number, Math.max(0, Math.min(position, track.length + 1)));
    const lift = this.liftAt(track, machine.index);
    if (lift === null) return spot;
    // Aboard: on the way to the platform or from it, else at the floor where that is.
    const platform = snapshot.machines[this.liftMachines.get(lift).node];
    const there = this.stopAt(lift, this.position(platform, nowUs));
    return Math.hypot(there.x - spot.x, there.y - spot.y) < 2 * this.cell ? spot : there;
  }

  liftAt(track, index) {
    if (index >= 1 && index <= track.length) return null;
    const spot = this.at(track.number, index < 1 ? 0 : track.length + 1);
    const near = ([x, y]) => Math.hypot(x * this.scale - spot.x, y * this.scale - spot.y) < this.cell / 2;
    const lift = this.lifts.find((one) => one.joins.some(([alley], stop) => alley === track.number && near(this.plan.platforms[one.number][stop])));
    return lift ? lift.number : null;
  }

  // A rectangle around two points, with half a slot to each side.
  span(one, other) {
    const half = this.cell / 2;
    const [x, y] = [Math.min(one.x, other.x) - half, Math.min(one.y, other.y) - half];
    return { x, y, w: Math.abs(one.x - other.x) + 2 * half, h: Math.abs(one.y - other.y) + 2 * half };
  }

  slot(track, index) {
    return this.strip(track, index, index);
  }

  // From one slot of a track to another: as long as its positions are apart, as wide as the narrowest alley's are.
  strip(track, first, last) {
    const [one, other] = [this.at(track, first), this.at(track, last)];
    const { dx } = this.heading(track);
    const along = (this.tracks.get(track).pitch_mm * this.scale) / 2, across = this.cell / 2;
    const [wide, high] = dx ? [along, across] : [across, along];
    const [x, y] = [Math.min(one.x, other.x) - wide, Math.min(one.y, other.y) - high];
    return { x, y, w: Math.abs(one.x - other.x) + 2 * wide, h: Math.abs(one.y - other.y) + 2 * high };
  }

  spurSlot(spur, index) {
    return this.slot(spur.number, index);
  }

  drawFloors(pen, snapshot) {
    pen.fillStyle = css("--dim");
    pen.textAlign = "left";
    pen.font = `600 ${Math.max(9, Math.min(18, this.cell * 0.7))}px system-ui`;
    for (const [level, x, y] of this.plan.floors) pen.fillText(`floor ${level}`, x * this.scale + 4, (y - 1100) * this.scale);
    pen.textAlign = "center";
    const tracks = [...this.alleys, ...this.spurs];
    this.drawWays(pen, tracks);
    for (const track of tracks) {
      for (let index = 1; index <= track.length; index++) {
        this.hits.push({ ...this.slot(track.number, index), what: "segment", id: `p(${track.number},${index})` });
        if (track.one_way && index % 3 === 1) this.arrow(pen, track, index);
        for (const side of [0, 1]) this.drawStation(pen, snapshot, track.number, index, side);
      }
    }
  }

  // All edges first and all slots over them: an edge is left where nothing goes on.
  drawWays(pen, tracks) {
    const parts = tracks.map((track) => this.strip(track.number, 1, track.length));
    for (const [track, end, mouth, index] of this.plan.links) {
      parts.push(this.span(this.at(mouth, index), this.at(track, end ? end - 1 : 1)));
    }
    for (const lift of this.lifts) {
      lift.joins.forEach(([track, index], stop) => parts.push(this.span(this.at(track, index), this.stopAt(lift.number, stop + 1))));
    }
    pen.strokeStyle = css("--line");
    pen.lineWidth = 2;
    for (const box of parts) pen.strokeRect(box.x, box.y, box.w, box.h);
    pen.lineWidth = 1;
    pen.fillStyle = css("--free");
    for (const box of parts) pen.fillRect(box.x, box.y, box.w, box.h);
    for (const spur of this.spurs) this.dashed(pen, this.strip(spur.number, 1, spur.length));
    // Where robots turn.
    pen.strokeStyle = css("--line");
    for (const [, , mouth, index] of this.plan.links) {
      const spot = this.at(mouth, index);
      pen.beginPath();
      pen.arc(spot.x, spot.y, this.cell * 0.2, 0, 7);
      pen.stroke();
    }
  }

  // Which way a one-way alley goes.
  arrow(pen, track, index) {
    const spot = this.at(track.number, index);
    const { dx, dy } = this.heading(track.number);
    const size = this.cell * 0.25;
    const [x, y] = [dx * track.one_way * size, dy * track.one_way * size];
    pen.strokeStyle = css("--dim");
    pen.beginPath();
    pen.moveTo(spot.x - x - y, spot.y - y + x);
    pen.lineTo(spot.x + x, spot.y + y);
    pen.lineTo(spot.x - x + y, spot.y - y - x);
    pen.stroke();
  }

  // The near side is to the right of growing index, seen from above.
  aside(track, side) {
    const { dx, dy } = this.heading(track);
    return side === 1 ? { x: dy, y: -dx } : { x: -dy, y: dx };
  }

  stationBox(track, index, side) {
    const slot = this.slot(track, index);
    const { x, y } = this.aside(track, side);
    const deep = this.plan.reach_mm * this.scale;
    const gap = Math.min(1.5, this.cell * 0.06);
    const box = x ? { ...slot, x: x > 0 ? slot.x + slot.w : slot.x - deep, w: deep } : { ...slot, y: y > 0 ? slot.y + slot.h : slot.y - deep, h: deep };
    return { x: box.x + gap, y: box.y + gap, w: box.w - 2 * gap, h: box.h - 2 * gap };
  }

  // Doors are at the two short sides, the inner one at the alley.
  drawDoors(pen, box, bay, doors) {
    const { x, y } = this.aside(bay.station >> 8, (bay.station >> 7) & 1);
    const edge = (outer) => (x ? { x: (x > 0) === outer ? box.x + box.w : box.x, y: box.y, w: 0, h: box.h } : { x: box.x, y: (y > 0) === outer ? box.y + box.h : box.y, w: box.w, h: 0 });
    for (const [outer, state] of [[true, doors.input], [false, doors.output]]) {
      const line = edge(outer);
      pen.strokeStyle = css(state === "locked" || state === "closed" ? "--ink" : "--hold");
      pen.lineWidth = 3;
      const open = state === "open" ? 0.12 : state === "opening" || state === "closing" ? 0.6 : 1;
      pen.beginPath();
      pen.moveTo(line.x, line.y);
      pen.lineTo(line.x + line.w * open, line.y + line.h * open);
      pen.stroke();
    }
    pen.lineWidth = 1;
    const outside = edge(true);
    pen.fillStyle = doors.light === "green" ? css("--hold") : css("--bad");
    pen.beginPath();
    pen.arc(outside.x + outside.w / 2 + x * 5, outside.y + outside.h / 2 + y * 5, 3, 0, 7);
    pen.fill();
  }

  crossBox(track, index) {
    return this.slot(track.number, index);
  }

  // A plan as corners, along the ways; in shafts from floor to floor it has no line.
  wayOf(told, from) {
    if (!from) return [];
    const way = [[from.x, from.y]];
    for (const [track, first, last] of told.plan) {
      const row = this.tracks.get(track);
      if (!row || row.kind === "lift") {
        if (row) this.jump(way, row, last);
        continue;
      }
      for (const index of [first, last]) {
        const spot = this.at(track, Math.max(0, Math.min(row.length + 1, index)));
        way.push([spot.x, spot.y]);
      }
    }
    const isSame = (one, other) => one && other && one[0] === other[0] && one[1] === other[1];
    return way.filter((point, number) => !number || !isSame(point, way[number - 1]));
  }

  jump(way, lift, stop) {
    const spot = this.stopAt(lift.number, stop);
    way.push(null, [spot.x, spot.y]);
  }

  drawShafts(pen, snapshot, nowUs) {
    for (const [track, machine] of this.liftMachines) {
      const here = this.where(machine.node, snapshot, nowUs);
      const stops = new Map(this.plan.platforms[track].map((_, number) => [number + 1, this.stopAt(track, number + 1)]));
      const spots = new Map([...stops.values()].map((spot) => [`${spot.x},${spot.y}`, spot]));
      for (const spot of spots.values()) {
        const box = this.span(spot, spot);
        const isHere = spot.x === here.x && spot.y === here.y;
        pen.strokeStyle = css("--lift");
        pen.lineWidth = isHere ? 3 : 1;
        pen.strokeRect(box.x + 1, box.y + 1, box.w - 2, box.h - 2);
        pen.lineWidth = 1;
        if (!isHere) continue;
        const isCrossed = hasFailed(snapshot.machines[machine.node]);
        const name = isCrossed ? null : this.text(pen, machine.name, { ...box, x: box.x + 3, w: box.w - 6 }, css("--ink"), 9);
        if (isCrossed) crossOut(pen, box);
        this.hits.push({ ...box, what: "machine", id: machine.node, name, words: machine.name, isCrossed });
      }
      for (const [stop, spot] of stops) this.drawLiftDoor(pen, spot, this.at(...this.tracks.get(track).joins[stop - 1]));
    }
  }

  // A thick line within a platform, at its edge towards a sill.
  drawLiftDoor(pen, spot, sill) {
    const half = this.cell / 2, thick = Math.max(2, this.cell * 0.12);
    const [x, y] = [sill.x - spot.x, sill.y - spot.y];
    const level = Math.abs(x) > Math.abs(y);
    const [dx, dy] = level ? [Math.sign(x), 0] : [0, Math.sign(y)];
    const [cx, cy] = [spot.x + dx * (half - thick / 2), spot.y + dy * (half - thick / 2)];
    const [w, h] = level ? [thick, 1.2 * half] : [1.2 * half, thick];
    pen.fillStyle = css("--lift");
    pen.fillRect(cx - w / 2, cy - h / 2, w, h);
    this.hits.push({ x: cx - w / 2, y: cy - h / 2, w, h, what: "door", id: null });
  }

  // As long as a carrier is.
  bodyBox(spot, track) {
    const long = this.layout.carrier_mm * this.scale, wide = this.cell * 0.8;
    const [w, h] = this.plan.lines[track] && this.heading(track).dx ? [long, wide] : [wide, long];
    return { x: spot.x - w / 2, y: spot.y - h / 2, w, h };
  }

  // The shuttle on its way into a place or back.
  drawShuttle(pen, told, spot) {
    const { x, y } = this.aside(told.track, told.shuttle.side);
    const out = Math.min(told.shuttle.mm, this.plan.reach_mm) * this.scale;
    const half = this.cell * 0.14;
    const end = { x: spot.x + x * out, y: spot.y + y * out };
    const left = Math.min(spot.x, end.x) - half, top = Math.min(spot.y, end.y) - half;
    pen.fillStyle = css("--robot");
    pen.fillRect(left, top, Math.abs(end.x - spot.x) + 2 * half, Math.abs(end.y - spot.y) + 2 * half);
  }
}
