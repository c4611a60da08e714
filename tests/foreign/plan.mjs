// Ways in space and time (chapter 7): legs, the windows in which they need segments, and plans around others.
import { ANY, frontOf, isSpur, reachUs } from "./site.mjs";

export const ROUND = 10_000; // T_round
export const WORK = "WORK";
const MOST_DELAYS = 200;
const overlap = (a, b, other) => a < other.b - ROUND && other.a < b - ROUND;
/** Where and when a robot is behind these steps: { track, index, us }. */
export const endOf = (steps) => steps.at(-1) && { track: steps.at(-1).track, index: steps.at(-1).to, us: steps.at(-1).end };

/** P4: [{ key, a, b, leg, from, to }] of legs with begin and end; the last place is kept without end. */
export function windowsOf(site, legs, isOpen = true) {
  const last = new Map();
  const found = [];
  const add = (key, a, b, leg, { from, to } = {}) => {
    const before = last.get(key);
    if (before?.b >= a - ROUND) {
      Object.assign(before, { b: Math.max(before.b, b), leg, from: before.from ?? from, to: to ?? before.to });
    } else {
      last.set(key, { key, a, b, leg, from, to });
      found.push(last.get(key));
    }
  };
  const half = (site.pitch + site.carrier.length_mm) / 2 + site.carrier.clearance_mm;
  legs.forEach((one, leg) => {
    const { action, track, from, to, begin, end, mouth } = one;
    const [step, count] = [Math.sign(to - from), action === "TRAVEL" ? Math.abs(to - from) : 0];
    if (action === "RIDE") add(track << 8, begin, end, leg, one);
    if (mouth !== undefined) add(mouth, begin, end, leg);
    if (action !== "RIDE" && !count) add(site.at(track, to), begin, end, leg);
    const mm = count * site.pitch;
    for (let k = 0; count && k <= count; k++) {
      const enter = begin + reachUs(k * site.pitch - half, mm, site.carrier);
      const leave = end - site.run(mm) + reachUs(Math.min(mm, k * site.pitch + half), mm, site.carrier);
      add(site.at(track, from + k * step), enter, k === count ? end : Math.max(enter, leave), leg);
    }
  });
  if (isOpen) last.get(site.at(legs.at(-1).track, legs.at(-1).to)).b = Infinity;
  return found;
}

/** Whether windows of two need the same at the same time: the first such pair. */
export function meeting(mine, theirs) {
  const pairs = mine.flatMap((one) => theirs.map((other) => [one, other]));
  return pairs.find(([one, other]) => one.key === other.key && overlap(one.a, one.b, other));
}

/** Puts whole ways off until nobody is in the way: it waits where it stands, and then goes through. */
export class Planner {
  /** `busy`: key: [{ a, b, from, to }], what others need; `refuges`: where it may rest, or nothing for no rest. */
  constructor(site, busy, refuges) {
    Object.assign(this, { site, busy, refuges });
  }

  /** The soonest way to do a task from `start`: { steps, over } with the rest behind it, or undefined. */
  task(call, start, free) {
    const { source, to } = call;
    const taken = call.isAboard
      ? [[]]
      : ways(this.site, start, frontOf(source)).map((way) => [...way, this.#work(call, source, true)]);
    const left = (to === ANY ? free : [to]).flatMap((sink) => taken.flatMap((way) => {
      const here = way.length ? { track: source >> 8, index: source & 0x7f } : start;
      return ways(this.site, here, frontOf(sink)).map((on) => [...way, ...on, this.#work(call, sink, false)]);
    }));
    return this.#soonest(start, left, Math.max(start.us, call.deadline + 150_000), call.ready);
  }

  /** The way to a refuge from standing somewhere. */
  rest(start) {
    const key = this.site.at(start.track, start.index);
    if (this.refuges.includes(key) && this.#begin([{ key, a: 0, b: Infinity }], start, start.us) !== undefined) return [];
    const all = this.refuges.flatMap((one) => ways(this.site, start, one)).filter((way) => way.length);
    return this.#soonest(start, all, start.us)?.steps;
  }

  #work(call, place, takes) {
    const index = place & 0x7f;
    return { action: WORK, track: place >> 8, from: index, to: index, place, takes, call };
  }

  #soonest(start, all, least, ready = 0) {
    let best;
    for (const [steps, over] of all.map((way) => this.#timed(way)).sort((a, b) => a[1] - b[1])) {
      if (best && least + over >= best.over) break;
      const isWork = steps.at(-1).action === WORK;
      const atBay = steps.find((one) => this.site.bays.has(one.place));
      const windows = windowsOf(this.site, steps, !isWork);
      const us = this.#begin(windows, start, Math.max(least, atBay ? ready - atBay.begin : 0));
      if (us === undefined || best?.over <= us + over) continue;
      const found = steps.map((one) => ({ ...one, begin: one.begin + us, end: one.end + us }));
      const rest = isWork && this.refuges ? this.rest(endOf(found)) : [];
      if (rest) best = { steps: [...found, ...rest], over: us + over };
    }
    return best;
  }

  #timed(way) {
    let us = 0;
    const steps = way.map((hop) => {
      const begin = us;
      us += hop.action === WORK ? this.site.handling(hop.place) : hopUs(this.site, hop);
      return { ...hop, begin, end: us };
    });
    return [steps, us];
  }

  /** The least time to begin, no sooner than `us`; where it stands until then it stands from the start. */
  #begin(windows, start, us) {
    const here = windows[0].key === this.site.at(start.track, start.index) ? windows[0] : undefined;
    const later = (one) => {
      const inWay = this.#needs(one).find((other) => overlap(one === here ? start.us : us + one.a, us + one.b, other));
      return inWay && (one === here ? Infinity : inWay.b - one.a);
    };
    for (let n = 0; n < MOST_DELAYS && us < Infinity; n++) {
      const found = windows.map(later).find((one) => one !== undefined);
      if (found === undefined) return us;
      us = found;
    }
    return undefined;
  }

  /** P6: a lift is free in the gaps between rides, less its own run to where this one begins and theirs. */
  #needs({ key, from: first, to: last }) {
    const run = (from, to) => (from === undefined || to === undefined ? 0 : this.site.ride(from, to));
    return (this.busy.get(key) ?? []).map(({ a, b, from, to }) => ({ a: a - run(last, from), b: b + run(to, first) }));
  }
}

/** B3: the least end of a task, of a robot before the car when the call ends, all ways free. */
export function floorOf(site, call) {
  const before = { track: call.source >> 8, index: call.source & 0x7f, us: call.deadline };
  return new Planner(site, new Map()).task(call, before, site.places).over;
}

export function hopUs(site, { action, from, to }) {
  if (action === "RIDE") return site.ride(from, to);
  return from === to ? site.run(site.pitch) + site.carrier.turn_ms * 1_000 : site.run(Math.abs(to - from) * site.pitch);
}

/** All ways from where something is to a segment, as hops. */
function ways(site, { track, index }, key) {
  const [goal, end] = [key >> 8, key & 0xff];
  const travel = (on, from, to) => (from === to ? [] : [{ action: "TRAVEL", track: on, from, to }]);
  const link = (into, beyond) => ({ action: "TRAVEL", track: into >> 8, from: into & 0xff, to: into & 0xff, mouth: beyond });
  if (track === goal) return [travel(track, index, end)];
  if (isSpur(track)) {
    const { mouth } = site.spurOf(track);
    const out = [...travel(track, index, 1), link(mouth, (track << 8) | 1)];
    return ways(site, { track: mouth >> 8, index: mouth & 0xff }, key).map((on) => [...out, ...on]);
  }
  if (isSpur(goal)) {
    const { mouth } = site.spurOf(goal);
    const into = [link((goal << 8) | 1, mouth), ...travel(goal, 1, end)];
    return ways(site, { track, index }, mouth).map((on) => [...on, ...into]);
  }
  return site.lifts.filter((one) => one.floors.includes(track) && one.floors.includes(goal)).map((lift) => {
    const [from, to] = [track, goal].map((floor) => lift.floors.indexOf(floor) + 1);
    const ride = { action: "RIDE", track: lift.track, from, to };
    return [...travel(track, index, site.sill(lift, track)), ride, ...travel(goal, site.sill(lift, goal), end)];
  });
}

/** P1, P2: steps as told: what waits between them, and where the first begins. */
export function legsOf(steps, awardUs) {
  const legs = [];
  let us = awardUs;
  for (const one of steps) {
    if (one.begin > us + ROUND && (legs.length || one.action === "TRAVEL")) {
      const [track, index] = one.mouth === undefined ? [one.track, one.from] : [one.mouth >> 8, one.mouth & 0xff];
      legs.push({ action: "STAND", track, from: index, to: index, begin: us, end: one.begin });
    }
    legs.push(one);
    us = one.end;
  }
  return legs;
}
