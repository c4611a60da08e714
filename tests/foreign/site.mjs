// What a builder takes from the site file (docs/site-file.md): ways, places, times. Lengths in mm, times in us.
export const [ANY, ABOARD, OUTSIDE] = [65535, 65535, 65534];
export const GATE = 255;

/** Of a straight site without further alleys; `text` is its TOML as an object. */
export class Site {
  constructor(text, digest) {
    const { floors, compartments, robots, lifts = [], spurs = [], stewards = {}, timing = {} } = text;
    this.digest = digest;
    this.bitrate = text.site.bitrate ?? 500_000;
    this.pitch = floors.pitch_mm ?? 2_400;
    this.carrier = { speed_mm_s: 1_500, acceleration_mm_s2: 500, length_mm: 2_300, clearance_mm: 50, turn_ms: 3_000, ...text.carrier };
    this.shuttle = { speed_mm_s: 750, acceleration_mm_s2: 500, reach_mm: 5_400, ...text.shuttle };
    this.lift = { speed_mm_s: 1_083, acceleration_mm_s2: 500, floor_height_mm: 2_500, ...text.lift };
    this.cars = { min_wheelbase_mm: 1_800, max_wheelbase_mm: 3_400, ...text.cars };
    const ms = { call_window_ms: 1_000, bid_delay_ms: 300, bid_half_ms: 10_000, deadline_guard_ms: 20, award_repeat_ms: 100,
      token_repeat_ms: 200, heartbeat_ms: 2_000, bus_time_ms: 5_000, door_ms: 3_000, grip_ms: 2_000, drive_refresh_ms: 200, ...timing };
    this.us = Object.fromEntries(Object.entries(ms).map(([key, value]) => [key.replace(/_ms$/, ""), value * 1_000]));
    this.floors = floors.count;
    this.length = new Map();
    for (let floor = 1; floor <= floors.count; floor++) this.length.set(floor, floors[floor]?.positions ?? floors.positions);
    this.lifts = lifts.map((one, n) => ({ ...one, track: 128 + n, floors: one.floors ?? [...this.length.keys()] }));
    this.spurs = spurs.map((one, n) => ({ track: 192 + n, mouth: segment(one.at), side: one.side ?? "far", length: one.length ?? 1 }));
    this.kinds = new Map(robots.map((one) => [one.node, "Robot"]));
    for (const one of lifts) this.kinds.set(one.node, "Lift");
    for (const one of compartments) this.kinds.set(one.node, "Compartment");
    this.nodes = [...this.kinds.keys()].sort((a, b) => a - b);
    this.homes = new Map(robots.map((one) => [segment(one.home), one.node]));
    this.bays = new Map(compartments.map((one) => [station(one.at, one.side ?? "near"), one.node]));
    this.fronts = new Set([...this.bays.keys()].map((one) => frontOf(one)));
    this.mouths = new Set(this.spurs.map((one) => one.mouth));
    const taken = new Set([...this.bays.keys(), ...this.spurs.map((one) => one.mouth | ((one.side === "far") << 7))]);
    this.places = [];
    for (const [floor, length] of this.length) {
      for (const side of floors[floor]?.sides ?? floors.sides ?? ["near", "far"]) {
        for (let index = 1; index <= length; index++) this.places.push((floor << 8) | ((side === "far") << 7) | index);
      }
    }
    this.places = this.places.filter((one) => !taken.has(one)).sort((a, b) => a - b);
    this.stewards = new Map([...this.length.keys()].map((floor) => [floor, this.#nearest(floor)]));
    for (const one of this.lifts) this.stewards.set(one.track, one.node);
    for (const one of this.spurs) this.stewards.set(one.track, this.#nearest(one.mouth >> 8)), this.length.set(one.track, one.length);
    const byName = new Map([...compartments, ...lifts].map((one) => [one.name, one.node]));
    for (const [track, name] of Object.entries(stewards)) this.stewards.set(Number(track), byName.get(name));
  }

  #nearest(floor) {
    const away = (node) => {
      const lift = this.lifts.find((one) => one.node === node);
      const tracks = lift ? lift.floors : [...this.bays].filter(([, one]) => one === node).map(([place]) => place >> 8);
      return Math.min(...tracks.map((one) => Math.abs(one - floor)));
    };
    const fixed = this.nodes.filter((node) => this.kinds.get(node) !== "Robot");
    return fixed.reduce((best, node) => (away(node) < away(best) ? node : best));
  }

  /** The segment at an index of a track: beyond an end of an alley the platform of the lift there. */
  at(track, index) {
    const end = index === 0 ? "left" : index === this.length.get(track) + 1 ? "right" : "";
    if (track >= 192 && index === 0) return this.spurs[track - 192].mouth;
    const lift = end && this.lifts.find((one) => one.end === end && one.floors.includes(track));
    return lift ? lift.track << 8 : (track << 8) | index;
  }

  /** Where a lift's platform is on an alley. */
  sill(lift, floor) {
    return lift.end === "left" ? 0 : this.length.get(floor) + 1;
  }

  liftOf(key) {
    return key >> 8 >= 128 && key >> 8 < 192 ? this.lifts[(key >> 8) - 128] : undefined;
  }

  /** P5: where a robot may rest while the plans of others end in `ends` (keys of segments). */
  refuges(ends) {
    const found = [];
    const busy = new Set(ends.map((one) => one >> 8));
    const fronts = new Set([...this.fronts].map((one) => one >> 8));
    const robots = [...this.kinds.values()].filter((one) => one === "Robot").length;
    for (const [track, length] of this.length) {
      const isSpur = track >= 192;
      if (busy.has(track) || (!isSpur && fronts.has(track) && (this.floors > 1 || robots > 1))) continue;
      for (let index = 1; index <= length; index++) {
        const key = (track << 8) | index;
        const isSill = this.lifts.some((one) => one.floors.includes(track) && Math.abs(this.sill(one, track) - index) === 1);
        if (!isSill && !this.fronts.has(key) && !this.mouths.has(key)) found.push(key);
      }
    }
    return found;
  }

  /** P4: a run of the carrier. */
  run(mm) {
    return runUs(mm, this.carrier);
  }

  /** A ride; the 0.4 s are for gate and sill. */
  ride(from, to) {
    return from === to ? 0 : runUs(Math.abs(to - from) * this.lift.floor_height_mm, this.lift) + 400_000;
  }

  /** B3. */
  handling(place) {
    return 2 * runUs(this.shuttle.reach_mm, this.shuttle) + this.us.grip + 400_000 + (this.bays.has(place) ? this.us.door : 0);
  }

  /** B4: how long a bid waits whose cost is so much above the floor. */
  delay(aboveUs, node) {
    const wait = aboveUs > 0 ? Math.floor((this.us.bid_delay * aboveUs) / (aboveUs + this.us.bid_half)) : 0;
    const slot = Math.floor(480_000_000 / this.bitrate) + 500;
    const round = this.nodes.length * slot;
    return Math.floor(wait / round) * round + this.nodes.indexOf(node) * slot;
  }
}

/** How far along a run of `mm` the carrier is after how long, from its start: the inverse of its motion, us. */
export function reachUs(way, mm, { speed_mm_s: v, acceleration_mm_s2: a }) {
  if (way <= 0) return 0;
  if (way >= mm) return runUs(mm, { speed_mm_s: v, acceleration_mm_s2: a });
  const [top, half] = [Math.min(v, Math.sqrt(mm * a)), mm / 2];
  const ramp = (top * top) / (2 * a);
  const first = (x) => (x <= ramp ? Math.sqrt((2 * x) / a) : top / a + (x - ramp) / top);
  return Math.floor(1e6 * (way <= half ? first(way) : 2 * first(half) - first(mm - way)));
}

function runUs(mm, { speed_mm_s: v, acceleration_mm_s2: a }) {
  const seconds = mm * a >= v * v ? mm / v + v / a : 2 * Math.sqrt(mm / a);
  return Math.ceil(Math.round(seconds * 1e6) / 1000) * 1000;
}

function segment(text) {
  const [track, index] = text.match(/\d+/g).map(Number);
  return (track << 8) | index;
}

function station(at, side) {
  return segment(at) | ((side === "far") << 7);
}

export const frontOf = (place) => (place & 0xff00) | (place & 0x7f);
