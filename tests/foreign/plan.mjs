// Ways in space and time (chapter 7): legs, the windows in which they need segments, and the soonest plan around others.
import { ANY, frontOf, reachUs } from "./site.mjs";

const ROUND = 10_000;
const MOST_GAPS = 12;
export const endOf = (steps) => steps.at(-1) && [steps.at(-1).track, steps.at(-1).to, steps.at(-1).end];
const isLink = (leg) => leg.action === "TRAVEL" && leg.from === leg.to;

/** P4: [{ key, a, b, leg, from, to }] of legs with begin and end; the last place is kept without end. */
export function windowsOf(site, legs, isOpen = true) {
  const last = new Map();
  const found = [];
  const add = (key, a, b, leg, ride = {}) => {
    const before = last.get(key);
    if (before && before.b >= a - ROUND) return Object.assign(before, { b: Math.max(before.b, b), leg, to: ride.to ?? before.to });
    last.set(key, { key, a, b, leg, ...ride });
    return found.push(last.get(key));
  };
  const { length_mm, clearance_mm } = site.carrier;
  legs.forEach(({ action, track, from, to, begin, end, mouth }, n) => {
    if (action === "RIDE") return add(track << 8, begin, end, n, { from, to });
    if (action !== "TRAVEL" || from === to) {
      if (mouth !== undefined) add(mouth, begin, end, n);
      return add(site.at(track, to), begin, end, n);
    }
    const [step, count] = [Math.sign(to - from), Math.abs(to - from)];
    const [mm, half] = [count * site.pitch, (site.pitch + length_mm) / 2 + clearance_mm];
    const whole = site.run(mm);
    for (let k = 0; k <= count; k++) {
      const enter = begin + reachUs(k * site.pitch - half, mm, site.carrier);
      const leave = end - whole + reachUs(Math.min(mm, k * site.pitch + half), mm, site.carrier);
      add(site.at(track, from + k * step), enter, k === count ? end : Math.max(enter, leave), n);
    }
    return undefined;
  });
  if (isOpen && found.length) last.get(site.at(legs.at(-1).track, legs.at(-1).to)).b = Infinity;
  return found;
}

/** Whether windows of two need the same at the same time: the first such pair. */
export function meeting(mine, theirs) {
  for (const one of mine) {
    for (const other of theirs) {
      if (one.key === other.key && one.a < other.b - ROUND && other.a < one.b - ROUND) return [one, other];
    }
  }
  return undefined;
}

export class Planner {
  /** `busy`: key: [{ a, b, from, to }], what others need; `ends`: where they rest. */
  constructor(site, busy, ends) {
    Object.assign(this, { site, busy, ends });
    this.refuges = site.refuges(ends);
  }

  /** The soonest way to do a task: { steps, over } or undefined. `free` are places for its car. */
  task(call, begin, free) {
    const sinks = call.to === ANY ? free : [call.to];
    const start = this.#start(begin, Math.max(begin[2], call.deadline + 150_000));
    const taken = call.isAboard ? start : this.#work(this.#go(start, frontOf(call.source)), call.source, true, call);
    const left = sinks.map((sink) => this.#work(this.#go(taken, frontOf(sink)), sink, false, call)).flat();
    for (const one of left.sort((a, b) => a.us - b.us)) {
      const rested = this.#rest([one]);
      if (rested) return { steps: stepsOf(rested), over: one.us };
    }
    return undefined;
  }

  /** The way to a refuge from standing somewhere. */
  rest(begin) {
    const rested = this.#rest(this.#start(begin, begin[2]));
    return rested && stepsOf(rested);
  }

  #start([track, index, us], begin) {
    const key = this.site.at(track, index);
    return [{ us: begin, limit: this.#free(this.busy.get(key) ?? [], us), track, index, key }];
  }

  #rest(states) {
    const here = states.filter((one) => one.limit === Infinity && this.refuges.includes(one.key));
    if (here.length) return here[0];
    const found = this.refuges.flatMap((key) => this.#go(states, key)).filter((one) => one.limit === Infinity);
    return found.sort((a, b) => a.us - b.us)[0];
  }

  #go(states, key) {
    const found = states.flatMap((state) =>
      ways(this.site, state, key).flatMap((way) => way.reduce((now, hop) => now.flatMap((one) => this.#hop(one, hop)), [state])),
    );
    const best = new Map();
    for (const one of found) if (!(best.get(one.limit)?.us <= one.us)) best.set(one.limit, one);
    return [...best.values()];
  }

  /** All gaps that a hop can end in, each as soon as it can. */
  #hop(state, hop) {
    const { site } = this;
    const still = { ...hop, begin: 0, end: hopUs(site, hop) };
    const windows = windowsOf(site, [still], false);
    const key = hop.action === "RIDE" ? hop.track << 8 : site.at(hop.track, hop.to);
    const leave = windows[0].key === state.key ? windows[0].b : still.end;
    const found = [];
    let us = state.us;
    for (let n = 0; n < MOST_GAPS; n++) {
      us = this.#soonest(windows, us, hop.ride, state);
      if (us + leave > state.limit + ROUND) break;
      const limit = this.#free(this.#needs(key, hop.ride), us + still.end);
      const step = { ...hop, begin: us, end: us + still.end };
      found.push({ us: us + still.end, limit, track: hop.track, index: hop.to, key, step, before: state });
      if (limit === Infinity || hop.action === "RIDE") break;
      us = Math.max(us + 1, ...this.#needs(key, hop.ride).filter((one) => one.a === limit).map((one) => one.b - windows.at(-1).a));
    }
    return found;
  }

  #soonest(windows, begin, ride, state) {
    let us = begin;
    for (let again = true, n = 0; again && us < Infinity && n < 200; n++) {
      again = false;
      for (const one of windows) {
        if (one.key === state.key) continue;
        for (const { a, b } of this.#needs(one.key, ride)) {
          if (us + one.a < b - ROUND && us + one.b > a + ROUND) [us, again] = [b - one.a, true];
        }
      }
    }
    return us;
  }

  /** P6: a lift is free in the gaps between rides, less its own run to where this one begins and theirs. */
  #needs(key, ride) {
    const busy = this.busy.get(key) ?? [];
    if (!ride || !this.site.liftOf(key)) return busy;
    const run = (from, to) => (from === undefined || to === undefined ? 0 : this.site.ride(from, to));
    return busy.map((one) => ({ a: one.a - run(ride[1], one.from), b: one.b + run(one.to, ride[0]) }));
  }

  #free(busy, us) {
    return Math.min(Infinity, ...busy.filter((one) => one.b > us + ROUND).map((one) => Math.max(one.a, us - ROUND)));
  }

  #work(states, place, takes, call) {
    return states.flatMap((one) => {
      const begin = Math.max(one.us, call.ready && this.site.bays.has(place) ? call.ready : 0);
      const end = begin + this.site.handling(place);
      if (end > one.limit + ROUND) return [];
      const index = place & 0x7f;
      const step = { action: "WORK", track: place >> 8, from: index, to: index, begin, end, place, takes, call };
      return [{ ...one, us: end, step, before: one }];
    });
  }
}

/** B3: the least end of a task, of a robot before the car when the call ends, all ways free. */
export function floorOf(site, call) {
  const free = new Planner(site, new Map(), []);
  free.refuges = [...site.length].flatMap(([track, length]) => Array.from({ length }, (_, n) => (track << 8) | (n + 1)));
  const before = [call.source >> 8, call.source & 0x7f, call.deadline];
  return free.task(call, before, site.places).over;
}

export function hopUs(site, hop) {
  if (hop.action === "RIDE") return site.ride(hop.from, hop.to);
  return isLink(hop) ? site.run(site.pitch) + site.carrier.turn_ms * 1_000 : site.run(Math.abs(hop.to - hop.from) * site.pitch);
}

/** All ways from where a state is to a segment, as hops. */
function ways(site, { track, index }, key) {
  const [goal, end] = [key >> 8, key & 0xff];
  const travel = (on, from, to) => (from === to ? [] : [{ action: "TRAVEL", track: on, from, to }]);
  if (track === goal) return [travel(track, index, end)];
  const [here, there] = [track, goal].map((one) => site.spurs.find((spur) => spur.track === one));
  if (here) {
    const link = { action: "TRAVEL", track: here.mouth >> 8, from: here.mouth & 0xff, to: here.mouth & 0xff, mouth: (track << 8) | 1 };
    const out = [...travel(track, index, 1), link];
    return ways(site, { track: here.mouth >> 8, index: here.mouth & 0xff }, key).map((one) => [...out, ...one]);
  }
  if (there) {
    const link = { action: "TRAVEL", track: goal, from: 1, to: 1, mouth: there.mouth };
    return ways(site, { track, index }, there.mouth).map((one) => [...one, link, ...travel(goal, 1, end)]);
  }
  return site.lifts.filter((one) => one.floors.includes(track) && one.floors.includes(goal)).map((lift) => {
    const ride = [lift.floors.indexOf(track) + 1, lift.floors.indexOf(goal) + 1];
    const hop = (one) => ({ ...one, ride });
    const on = travel(track, index, site.sill(lift, track));
    return [...on, { action: "RIDE", track: lift.track, from: ride[0], to: ride[1] }, ...travel(goal, site.sill(lift, goal), end)].map(hop);
  });
}

function stepsOf(state) {
  const steps = [];
  for (let one = state; one.step; one = one.before) steps.unshift(one.step);
  return steps;
}

/** P1, P2: steps as told: what waits between them, and where the first begins. */
export function legsOf(steps, awardUs) {
  const legs = [];
  let us = awardUs;
  for (const one of steps) {
    const isLater = one.begin > us + ROUND;
    if (isLater && (legs.length || one.action === "TRAVEL")) {
      const [track, index] = one.mouth !== undefined ? [one.mouth >> 8, one.mouth & 0xff] : [one.track, one.from];
      legs.push({ action: "STAND", track, from: index, to: index, begin: us, end: one.begin });
    }
    legs.push(one);
    us = one.end;
  }
  return legs;
}

