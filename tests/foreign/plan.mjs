// Ways in space and time (chapter 7): legs, the windows in which they need segments, and plans around others.
import { ANY, frontOf, isSpur, reachUs } from "./site.mjs";

export const ROUND = 10_000; // T_round
export const WORK = "WORK";
const MOST_DELAYS = 200;
const overlap = (a, b, other) => a < other.b - ROUND && other.a < b - ROUND;
/** Where a thing at a station's or segment's number is. */
export const spotOf = (key) => ({ track: key >> 8, index: key & 0x7f });
/** Where and when a robot is behind these steps: { track, index, us }. */
export const endOf = (steps) => steps.slice(-1).map(({ track, to, end }) => ({ track, index: to, us: end }))[0];
export const workAt = (place, more) => {
  return { action: WORK, track: place >> 8, from: place & 0x7f, to: place & 0x7f, place, ...more };
};

/** P4: [key, from when, until when] of what a leg needs. */
function passed(site, { action, track, from, to, begin, end, mouth }) {
  if (action === "RIDE") return [[track << 8, begin, end]];
  const here = [[site.at(track, to), begin, end]];
  if (action !== "TRAVEL" || from === to) return mouth === undefined ? here : [[mouth, begin, end], ...here];
  const [count, way] = [Math.abs(to - from), Math.sign(to - from)];
  const [mm, half] = [count * site.pitch, (site.pitch + site.carrier.length_mm) / 2 + site.carrier.clearance_mm];
  return Array.from({ length: count + 1 }, (_, k) => {
    const enter = begin + reachUs(k * site.pitch - half, mm, site.carrier);
    const leave = end - site.run(mm) + reachUs(Math.min(mm, k * site.pitch + half), mm, site.carrier);
    return [site.at(track, from + k * way), enter, k === count ? end : Math.max(enter, leave)];
  });
}

/** [{ key, a, b, leg, from, to }] of legs with begin and end; the last place is kept without end. */
export function windowsOf(site, legs, isOpen = true) {
  const last = new Map();
  const found = [];
  legs.forEach((one, leg) => {
    const stops = one.action === "RIDE" ? { from: one.from, to: one.to } : {};
    for (const [key, a, b] of passed(site, one)) {
      const before = last.get(key);
      const isOn = before?.b >= a - ROUND;
      if (!isOn) found.push({ key, a, b, leg, ...stops });
      else Object.assign(before, { b: Math.max(before.b, b), leg, ...stops, from: before.from ?? stops.from });
      if (!isOn) last.set(key, found.at(-1));
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
    const on = (way, from, place, takes) => {
      return ways(this.site, from, frontOf(place)).map((more) => [...way, ...more, workAt(place, { takes, call })]);
    };
    const taken = call.isAboard ? [[]] : on([], start, source, true);
    const from = call.isAboard ? start : spotOf(source);
    const all = (to === ANY ? free : [to]).flatMap((sink) => taken.flatMap((way) => on(way, from, sink, false)));
    return this.#soonest(start, all, Math.max(start.us, call.deadline + 150_000), call.ready);
  }

  /** The way to a refuge from standing somewhere: steps, none where it is in one. */
  rest(start) {
    const key = this.site.at(start.track, start.index);
    const us = this.refuges.includes(key) ? this.#begin([{ key, a: 0, b: Infinity }], start, start.us) : undefined;
    const all = this.refuges.flatMap((one) => ways(this.site, start, one)).filter((way) => way.length);
    return us === undefined ? this.#soonest(start, all, start.us)?.steps : [];
  }

  #soonest(start, all, least, ready = 0) {
    let best;
    for (const [steps, over] of all.map((way) => timed(this.site, way)).sort((a, b) => a[1] - b[1])) {
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

  /** The least time to begin, no sooner than `us`; where it stands until then it stands from the start. */
  #begin(windows, start, us) {
    const here = windows.find(({ key }, n) => n === 0 && key === this.site.at(start.track, start.index));
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
    const run = (from, to) => from && to && this.site.ride(from, to);
    const padded = ({ a, b, from, to }) => ({ a: a - (run(last, from) || 0), b: b + (run(to, first) || 0) });
    return (this.busy.get(key) ?? []).map(padded);
  }
}

/** B3: the least end of a task, of a robot before the car when the call ends, all ways free. */
export function floorOf(site, call) {
  return new Planner(site, new Map()).task(call, { ...spotOf(call.source), us: call.deadline }, site.places).over;
}

export function hopUs(site, { action, from, to, place }) {
  if (action === WORK) return site.handling(place);
  if (action === "RIDE") return site.ride(from, to);
  return from === to ? site.run(site.pitch) + site.carrier.turn_ms * 1_000 : site.run(Math.abs(to - from) * site.pitch);
}

/** Steps without a pause, from 0 on, and how long they last. */
function timed(site, way) {
  let us = 0;
  const steps = way.map((hop) => {
    const begin = us;
    us += hopUs(site, hop);
    return { ...hop, begin, end: us };
  });
  return [steps, us];
}

/** All ways from where something is to a segment, as hops. */
function ways(site, { track, index }, key) {
  const [goal, end] = [key >> 8, key & 0xff];
  const travel = (on, from, to) => (from === to ? [] : [{ action: "TRAVEL", track: on, from, to }]);
  const link = (into, mouth) => ({ action: "TRAVEL", track: into >> 8, from: into & 0xff, to: into & 0xff, mouth });
  if (track === goal) return [travel(track, index, end)];
  if (isSpur(track)) {
    const { mouth } = site.spurOf(track);
    const out = [...travel(track, index, 1), link(mouth, (track << 8) | 1)];
    return ways(site, spotOf(mouth), key).map((on) => [...out, ...on]);
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
  return steps.flatMap((one, n) => {
    const begin = n ? steps[n - 1].end : awardUs;
    const { track, index } = one.mouth === undefined ? { track: one.track, index: one.from } : spotOf(one.mouth);
    const stand = { action: "STAND", track, from: index, to: index, begin, end: one.begin };
    return one.begin > begin + ROUND && (n || one.action === "TRAVEL") ? [stand, one] : [one];
  });
}
