// What a builder takes from the site file (docs/site-file.md): ways, places, times. Lengths in mm, times in us.
export const [ANY, ABOARD, OUTSIDE] = [65535, 65535, 65534];
const [FIRST_LIFT, FIRST_SPUR] = [128, 192];
const DEFAULTS = {
  carrier: { speed_mm_s: 1_500, acceleration_mm_s2: 500, length_mm: 2_300, clearance_mm: 50, turn_ms: 3_000 },
  shuttle: { speed_mm_s: 750, acceleration_mm_s2: 500, reach_mm: 5_400 },
  lift: { speed_mm_s: 1_083, acceleration_mm_s2: 500, floor_height_mm: 2_500 },
  cars: { min_wheelbase_mm: 1_800, max_wheelbase_mm: 3_400 },
  timing: {
    call_window_ms: 1_000, bid_delay_ms: 300, bid_half_ms: 10_000, deadline_guard_ms: 20, token_repeat_ms: 200,
    heartbeat_ms: 2_000, bus_time_ms: 5_000, door_ms: 3_000, grip_ms: 2_000, drive_refresh_ms: 200,
  },
};
export const frontOf = (place) => place & 0xff7f;
export const isSpur = (track) => track >= FIRST_SPUR;
export const gateOf = (platform) => platform | 255;
const segment = (text) => Number(text.match(/\d+/g)[0]) * 256 + Number(text.match(/\d+/g)[1]);
const station = ({ at, side }, usual) => segment(at) | (((side ?? usual) === "far") << 7);

/** Of a straight site without further alleys; `text` is its TOML as an object. */
export class Site {
  constructor(text, digest) {
    const { site, floors, compartments, robots, lifts = [], spurs = [], stewards = {} } = text;
    for (const [name, values] of Object.entries(DEFAULTS)) this[name] = { ...values, ...text[name] };
    this.us = Object.fromEntries(Object.entries(this.timing).map(([key, ms]) => [key.replace("_ms", ""), ms * 1_000]));
    Object.assign(this, { digest, bitrate: site.bitrate ?? 500_000, pitch: floors.pitch_mm ?? 2_400 });
    const numbers = Array.from({ length: floors.count }, (_, n) => n + 1);
    this.lifts = lifts.map((one, n) => ({ floors: numbers, ...one, track: FIRST_LIFT + n }));
    this.spurs = spurs.map((one, n) => ({ length: 1, ...one, track: FIRST_SPUR + n, mouth: segment(one.at) }));
    const alleys = numbers.map((floor) => [floor, floors.positions]);
    this.length = new Map([...alleys, ...this.spurs.map((one) => [one.track, one.length])]);
    const kinds = { Robot: robots, Lift: this.lifts, Compartment: compartments };
    const machines = Object.entries(kinds).flatMap(([kind, all]) => all.map((one) => ({ ...one, kind })));
    machines.sort((a, b) => a.node - b.node);
    this.kinds = new Map(machines.map((one) => [one.node, one.kind]));
    this.nodes = [...this.kinds.keys()];
    this.homes = new Map(robots.map((one) => [segment(one.home), one.node]));
    this.bays = new Map(compartments.map((one) => [station(one, "near"), one.node]));
    this.fronts = new Set([...this.bays.keys()].map(frontOf));
    // A track's steward is the fixed machine nearest to it: here the lowest that reaches it, or the lowest at all.
    const fixed = machines.filter((one) => one.kind !== "Robot");
    const isAt = (one, floor) => (one.floors ?? [segment(one.at) >> 8]).includes(floor);
    const steward = (floor) => (fixed.find((one) => isAt(one, floor)) ?? fixed[0]).node;
    const shafts = this.lifts.map((one) => [one.track, one.node]);
    const branches = this.spurs.map((one) => [one.track, steward(one.mouth >> 8)]);
    const byName = new Map(fixed.map((one) => [one.name, one.node]));
    const named = Object.entries(stewards).map(([track, name]) => [Number(track), byName.get(name)]);
    this.stewards = new Map([...numbers.map((floor) => [floor, steward(floor)]), ...shafts, ...branches, ...named]);
    const row = ([track, length]) => Array.from({ length }, (_, n) => (track << 8) | (n + 1));
    const sides = (key) => (floors.sides ?? ["near", "far"]).map((side) => key | ((side === "far") << 7));
    const taken = new Set([...this.bays.keys(), ...spurs.map((one) => station(one, "far"))]);
    this.segments = [...this.length].flatMap(row);
    this.places = alleys.flatMap(row).flatMap(sides).filter((one) => !taken.has(one));
  }

  /** Where a lift's platform is on an alley. */
  sill = (lift, floor) => (lift.end === "left" ? 0 : this.length.get(floor) + 1);
  liftOf = (key) => this.lifts[(key >> 8) - FIRST_LIFT];
  spurOf = (track) => this.spurs[track - FIRST_SPUR];
  /** C1: who keeps a station, and so the car in it. */
  keeper = (place) => this.bays.get(place) ?? this.stewards.get(place >> 8);

  /** The segment at an index of a track: beyond an end of an alley the platform there, of a spur its mouth. */
  at(track, index) {
    if (isSpur(track) && index === 0) return this.spurOf(track).mouth;
    const lift = this.lifts.find((one) => one.floors.includes(track) && this.sill(one, track) === index);
    return lift ? lift.track << 8 : (track << 8) | index;
  }

  /** P5: where a robot may rest while the plans of others end in `ends` (keys of segments). */
  refuges(ends) {
    const isShared = this.nodes.length > 1 + this.bays.size; // other robots, or lifts
    const closed = new Set([...ends, ...(isShared ? this.fronts : [])].map((one) => one >> 8));
    const sides = (one, floor) => [-1, 1].map((n) => this.at(floor, this.sill(one, floor) + n));
    const besides = (one) => one.floors.flatMap((floor) => sides(one, floor));
    const busy = new Set([...this.fronts, ...this.spurs.map((one) => one.mouth), ...this.lifts.flatMap(besides)]);
    return this.segments.filter((key) => !closed.has(key >> 8) && !busy.has(key));
  }

  /** P4: a run of the carrier, and a ride; its 0.4 s are for gate and sill. B3: work at a place. */
  run = (mm) => runUs(mm, this.carrier);
  ride = (from, to) => from !== to && runUs(Math.abs(to - from) * this.lift.floor_height_mm, this.lift) + 400_000;
  handling = (place) =>
    2 * runUs(this.shuttle.reach_mm, this.shuttle) + this.us.grip + 400_000 + (this.bays.has(place) && this.us.door);

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
  const [top, half] = [Math.min(v, Math.sqrt(mm * a)), mm / 2];
  const ramp = (top * top) / (2 * a);
  const first = (x) => (x <= ramp ? Math.sqrt((2 * x) / a) : top / a + (x - ramp) / top);
  const seconds = way <= half ? first(Math.max(0, way)) : 2 * first(half) - first(Math.max(0, mm - way));
  return Math.floor(1e6 * seconds);
}

function runUs(mm, { speed_mm_s: v, acceleration_mm_s2: a }) {
  const seconds = mm * a >= v * v ? mm / v + v / a : 2 * Math.sqrt(mm / a);
  return Math.ceil(Math.round(seconds * 1e6) / 1000) * 1000;
}
