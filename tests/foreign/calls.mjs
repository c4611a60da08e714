// Calls, bids, tasks, and what others plan (chapters 4 to 7).
import { Fleet, newer } from "./fleet.mjs";
import { Planner, endOf, floorOf, legsOf, meeting, windowsOf } from "./plan.mjs";
import { frontOf } from "./site.mjs";
import { carKey } from "./tokens.mjs";

const [S, MS] = [1_000_000, 1_000];
const MOST_LEGS = 31;
const reference = (origin, number) => origin * 65_536 + number;
const task = (word) => reference(word.task_origin, word.task_number);

export class Calls extends Fleet {
  constructor(setup, journal) {
    super(setup, journal);
    Object.assign(this, { version: 0, stamp: [0, this.node, 0], steps: [], calls: new Map(), leftOut: new Map(), sets: new Map(), order: new Map(), needed: [] });
    this.tasks = new Map(journal.tasks); // task: { call, phase }, what was won
    this.done = new Map(journal.done); // task: where the car was left
    this.forfeits = new Map(); // task: [reason, times, due]
  }

  journal() {
    return { ...super.journal(), tasks: [...this.tasks], done: [...this.done] };
  }

  hear(word, peer) {
    const { name } = word;
    if (name.startsWith("Token") && name !== "TokenAssigned") {
      if (peer && !this.ownUntil) this.tokens.hear(word);
    } else if (name === "TokenAssigned") {
      const key = (["SEGMENT", "STATION", "CAR", "TASK"].indexOf(word.token_kind) << 24) | word.token;
      if (this.frozen && !this.frozen.list.some(([one]) => one === key)) this.frozen.list.push([key, word.version, word.holder]);
    } else if (name === "Heartbeat" && peer) this.onHeartbeat(word, peer);
    else if (name.startsWith("Sync")) this.onSync(word, peer);
    else if (name === "Regeneration") this.onRegeneration(word);
    else if (name === "Halted" && word.machine === word.sender) Object.assign(peer, { halted: true, reason: word.reason });
    else if (/^(Call|LeftOut)/.test(name)) this.#onCall(word);
    else if (name === "Bid") this.#onBid(word, peer);
    else if (name === "Award") this.#onAward(word);
    else if (name === "CarAt") this.#onCar(word);
    else if (name.startsWith("Itinerary")) this.#onPlan(word, peer);
    else if (name === "Progress") this.#onPlace(word, peer);
    else if (name === "Blocked" || name === "Clear") this.#onBlocked(word);
    if (peer && ["Waiting", "TaskReport", "TokenRequest", "ItineraryHead"].includes(name)) peer.waitsUs = this.now;
  }

  // --- what others plan, and where they are

  #onPlan(word, peer) {
    if (word.name === "ItineraryHead") {
      if (peer.open?.version === word.version && peer.open.head.stamp_award_ms !== word.stamp_award_ms) peer.open = undefined;
      else peer.open = { version: word.version, head: word, legs: [], said: this.now };
    } else if (peer.open?.version === word.version && this.now < peer.open.said + S) Object.assign(peer.open, { said: this.now }).legs[word.leg] = word;
    const { head, legs } = peer.open ?? {};
    if (!head || Object.keys(legs).length < head.legs) return;
    peer.open = undefined;
    if (head.grade === "TENTATIVE" || (peer.plan && !newer(head.version, peer.plan.version, 8))) return;
    const award = this.near(head.stamp_award_ms);
    let [begin, here] = [award, peer.place?.track];
    const steps = legs.map(({ action, track, side, from_index: from, to_index: to, end_ms }) => {
      const end = award + end_ms * MS;
      const mouth = action === "TRAVEL" && from === to ? this.#beyond(track, to, here) : undefined;
      const place = (track << 8) | (Number(side === "FAR") << 7) | to;
      const step = { action, track, from, to, begin, end, mouth, place };
      [begin, here] = [end, track];
      return step;
    });
    const stamp = [head.stamp_award_ms, head.stamp_initiator, head.stamp_call];
    peer.plan = head.grade === "RELEASED" ? undefined : { version: head.version, stamp, steps, leg: 0 };
    if (peer.plan) peer.plan.windows = windowsOf(this.site, steps);
    this.compare();
  }

  /** The other side of a linked end that a leg goes over. */
  #beyond(track, index, before) {
    const isHere = (one) => one.track === before && one.mouth === ((track << 8) | index);
    const spur = this.site.spurs.find((one) => one.track === track) ?? this.site.spurs.find(isHere);
    return spur && (spur.track === track ? spur.mouth : (spur.track << 8) | 1);
  }

  #onPlace({ itinerary_version, leg, track, index, offset_mm, speed_mm_s, sender }, peer) {
    const lift = this.site.lifts.find((one) => one.node === sender);
    if (lift) peer.stop = { index, isStill: speed_mm_s === 0 && Math.abs(offset_mm) <= 5, mark: (leg << 8) | itinerary_version };
    const place = { track, index, key: this.site.at(track, index) };
    if (peer.place?.key !== place.key) peer.movedUs = this.now;
    peer.place = place;
    if (peer.plan?.version !== itinerary_version) return;
    Object.assign(peer.plan, { leg: Math.max(leg, peer.plan.leg) });
    const now = peer.plan.steps[peer.plan.leg];
    const left = (key) => now?.track === track && key >> 8 === track && ((key & 0xff) - index) * Math.sign(now.to - now.from) < 0;
    peer.plan.windows = peer.plan.windows.filter((one) => one.leg > leg || (one.leg === leg && !left(one.key)));
  }

  /** J6: it stands where its plan has left. */
  hasLeft(peer) {
    const here = peer.plan.windows.some((one) => one.key === peer.place?.key && one.b > this.now - 20 * S);
    const since = Math.max(peer.movedUs ?? 0, peer.plan.windows.filter((one) => one.key === peer.place?.key).at(-1)?.b ?? 0);
    return Boolean(peer.place) && !here && this.now > since + (peer.waitsUs > since ? 600 : 20) * S;
  }

  #onBlocked({ name, sender, track, index }) {
    if (sender <= 250 && this.site.stewards.get(track) !== sender) return this.drop("NOT_AUTHORISED");
    if (name === "Blocked") this.blocked.add((track << 8) | index);
    else this.blocked.delete((track << 8) | index);
    this.beatSoon();
    return this.compare();
  }

  get robots() {
    return this.others.filter((one) => this.site.kinds.get(one.node) === "Robot");
  }

  /** What the others need, and where they rest. */
  planner() {
    const busy = new Map();
    const add = (key, window) => (busy.has(key) ? busy.get(key).push(window) : busy.set(key, [window]));
    const ends = [];
    for (const one of this.robots) {
      const isIdle = !one.plan || this.isObstacle(one);
      if (isIdle && one.place) add(one.place.key, { a: -Infinity, b: Infinity });
      if (!isIdle) one.plan.windows.forEach((window) => add(window.key, window));
      const end = !isIdle && one.plan.steps.at(-1);
      if (end || one.place) ends.push(end ? this.site.at(end.track, end.to) : one.place.key);
      for (const [key, [, holder]] of isIdle ? this.tokens.believed : []) if (holder === one.node && key < 1 << 24) add(key, { a: -Infinity, b: Infinity });
    }
    for (const key of this.blocked) add(key, { a: -Infinity, b: Infinity });
    for (const lift of this.site.lifts) {
      const { stop } = this.peers.get(lift.node);
      const mine = this.steps.findLast((one) => one.track === lift.track);
      const last = mine ? { b: mine.end, to: mine.to } : stop && { b: this.now, to: stop.index };
      if (last) add(lift.track << 8, { a: -Infinity, ...last });
    }
    return new Planner(this.site, busy, ends);
  }

  /** K12: who passes a segment right before a robot, by the plans that I know; me too. */
  before(key, node) {
    const windows = (one) => (one === this.node ? this.windows : (this.peers.get(one).plan?.windows ?? []));
    const own = windows(node).find((one) => one.key === key);
    const others = [this.node, ...this.robots.filter((one) => !this.isObstacle(one)).map((one) => one.node)].filter((one) => one !== node);
    const found = others.flatMap((other) => windows(other).filter((one) => own && one.key === key && this.#isBefore(other, one, own, node)).map(({ a }) => [a, other]));
    return found.sort((a, b) => b[0] - a[0])[0]?.[1] ?? 0;
  }

  /** K13 asks for all or none without a plan. */
  claim(key) {
    return this.all ? { itinerary_version: 0, predecessor: 0 } : { itinerary_version: this.version, predecessor: this.before(key, this.node) };
  }

  /** K12, K14: why a request is not served now; empty where it is. */
  objection(key, node, { plan, predecessor }) {
    const peer = this.peers.get(node);
    const body = this.body();
    if (key >= 1 << 24 || this.site.liftOf(key) || body.includes(key) || !peer || this.now - peer.heard > 1.25 * this.site.us.heartbeat) return "TOKEN_NOT_GRANTABLE_YET";
    const needs = this.needed.includes(key) && (this.isRunning || this.before(key, node) === this.node);
    if (needs) return "TOKEN_NOT_GRANTABLE_YET";
    if (plan === 0) return "";
    const sees = this.before(key, node);
    const isOther = predecessor !== sees && predecessor !== this.node;
    if (peer.plan && !newer(plan, peer.plan.version, 8) && !isOther) return sees && sees !== this.node ? "TOKEN_NOT_GRANTABLE_YET" : "";
    for (const one of [node, predecessor]) {
      const of = this.peers.get(one);
      if (!of || this.now < (of.viewUs ?? -S) + S || this.site.kinds.get(one) !== "Robot") continue;
      of.viewUs = this.now;
      this.ask(one, 0, this.now);
    }
    return "MIRROR_BEHIND";
  }

  #isBefore(other, theirs, mine, node) {
    const overlap = theirs.a < mine.b - 10 * MS && mine.a < theirs.b - 10 * MS;
    const known = this.order.get(`${other === this.node ? node : other} ${mine.key}`);
    return overlap && known !== undefined ? known !== (other === this.node) : theirs.a < mine.a;
  }

  get windows() {
    return windowsOf(this.site, this.steps.length ? this.steps : [this.standing()]);
  }

  standing() {
    const { track, index } = this.place;
    return { action: "STAND", track, from: index, to: index, begin: this.now, end: this.now };
  }

  /** P7, P8: whose plans meet mine, and whether it is I who makes it anew. */
  compare() {
    if (!this.version || !this.place) return;
    const mine = this.windows;
    const order = new Map();
    this.meets = mine.find((one) => this.blocked.has(one.key)) && { node: 0 };
    for (const { node, plan } of this.robots.filter((one) => one.plan && !this.isObstacle(one))) {
      const pair = meeting(mine, plan.windows);
      if (pair && this.#yields(node, plan, ...pair)) this.meets = { node, stamp: plan.stamp };
      for (const one of mine) {
        const theirs = plan.windows.find((other) => other.key === one.key);
        const [name, meet] = [`${node} ${one.key}`, theirs && theirs.a < one.b - 10 * MS && one.a < theirs.b - 10 * MS];
        if (theirs && !meet) order.set(name, theirs.a < one.a);
        else if (theirs && this.order.has(name)) order.set(name, this.order.get(name));
      }
    }
    this.order = order;
  }

  #yields(node, plan, mine, theirs) {
    if (mine.b === Infinity && !this.steps.length) return true;
    if (theirs.b === Infinity && plan.windows.length === 1) return false;
    if (this.order.has(`${node} ${mine.key}`)) return this.order.get(`${node} ${mine.key}`);
    if (this.tokens.holds(mine.key)) return false;
    if (this.tokens.belief(mine.key)[1] === node) return true;
    const [works, theirWorks] = [this.steps, plan.steps.slice(plan.leg)].map((steps) => steps.some((one) => one.action === "WORK"));
    if (works !== theirWorks) return theirWorks;
    const [[a, b, c], [x, y, z]] = [this.stamp, plan.stamp];
    return a !== x ? newer(a, x, 32) : b !== y ? b > y : c > z;
  }

  // --- calls and bids

  near(ms) {
    const now = Math.floor(this.now / MS);
    const away = (((ms - now) % 2 ** 32) + 2 ** 32) % 2 ** 32;
    return (now + (away >= 2 ** 31 ? away - 2 ** 32 : away)) * MS;
  }

  #onCall(word) {
    const key = `${word.sender} ${word.call}`;
    if (word.name === "LeftOut") {
      const nodes = ["a", "b", "c", "d", "e", "f"].map((one) => word[`node_${one}`]);
      return this.leftOut.set(key, [...(this.leftOut.get(key) ?? []), ...nodes.filter(Boolean)]);
    }
    if (this.calls.has(key)) return undefined;
    if (!this.sets.has(key)) this.sets.set(key, { said: this.now });
    const set = this.sets.get(key);
    const isOther = set[word.name] && Object.keys(word).some((one) => one !== "senders" && set[word.name][one] !== word[one]);
    if (isOther) return this.sets.delete(key);
    Object.assign(set, { [word.name]: word, said: this.now });
    const { Call: head, CallTerms: terms, CallLoad: load, CallParent: parent } = set;
    if (!head || !terms || !load || (head.depth && !parent)) return undefined;
    this.sets.delete(key);
    return this.#opened(key, head, terms, load, parent);
  }

  #opened(key, head, terms, load, parent) {
    const { sender: initiator, call: number } = head;
    const deadline = this.near(terms.deadline_ms);
    const known = ["PARK", "RETRIEVE"].includes(head.operation) && head.criterion === "FINISH_TIME" && !head.depth;
    const { call_window: window, deadline_guard: guard } = this.site.us;
    for (const [other, one] of this.calls) {
      if (one.initiator !== initiator || one.task !== task(head)) continue;
      if (deadline < one.deadline && !newer(number, one.number, 16)) return;
      this.calls.delete(other);
    }
    this.forfeits.delete(task(head));
    const inTime = this.now < deadline - 2 * guard && deadline <= this.now + 60 * window;
    if (!known || !inTime || !["ANY", "ROBOT"].includes(head.kind)) return;
    const soonest = this.site.bays.has(terms.from_station) ? deadline - window + 9_500 * MS + this.site.us.door : 0;
    const ready = parent?.ready_ms ? deadline + parent.ready_ms * MS : soonest;
    const car = reference(load.car_origin, load.car_number);
    const ends = { source: terms.from_station, to: load.to_station };
    const call = { key, initiator, number, task: task(head), deadline, deadline_ms: terms.deadline_ms, ...ends, ready, car, wheelbase: load.wheelbase_mm, heard: this.now };
    call.floor = floorOf(this.site, call);
    this.calls.set(key, call);
    this.#search(call);
  }

  /** Where a further task begins: behind all work in hand and bid for. */
  #free(without) {
    const bids = [...this.calls.values()].filter((one) => one.isMine && one !== without && !this.tasks.has(one.task));
    const kept = this.kept();
    const ends = [endOf(kept) ?? [this.place.track, this.place.index, this.now]];
    for (const one of bids) {
      const work = one.steps.findLastIndex((step) => step.action === "WORK");
      ends.push(endOf(one.steps.slice(0, work + 1)));
    }
    const last = ends.reduce((a, b) => (b[2] > a[2] ? b : a));
    return [last[0], last[1], Math.max(last[2] + this.late, this.now)];
  }

  /** What of the plan stays for a task behind it: all up to the last work, else the run in hand. */
  kept() {
    const work = this.steps.findLastIndex((one) => one.action === "WORK");
    if (work >= 0) return this.steps.slice(0, work + 1);
    return this.inHand();
  }

  freePlaces(but) {
    const taken = new Set([...this.cars.values()].map((one) => one.station));
    for (const one of this.tasks.values()) if (one.call !== but && one.sink) taken.add(one.sink);
    for (const one of this.robots) for (const step of one.plan?.steps ?? []) if (step.action === "WORK") taken.add(step.place);
    return this.site.places.filter((one) => !taken.has(one) && !this.blocked.has(frontOf(one)));
  }

  #search(call) {
    const { min_wheelbase_mm: least, max_wheelbase_mm: most } = this.site.cars;
    const fits = call.wheelbase === 1_500 || (call.wheelbase >= least && call.wheelbase <= most);
    const found = fits && this.place && this.planner().task(call, this.#free(call), this.freePlaces());
    call.due = undefined;
    if (!found) return false;
    Object.assign(call, { steps: found.steps, cost: found.over });
    call.due = call.heard + this.site.delay(found.over - call.floor, this.node);
    return true;
  }

  #onBid({ sender, initiator, call: number, cost }, peer) {
    const call = this.calls.get(`${initiator} ${number}`);
    if (!call || !peer || this.isObstacle(peer) || this.leftOut.get(call.key)?.includes(sender)) return;
    const us = this.near(cost);
    if (us < call.floor - 500 * MS || this.now > call.deadline - this.site.us.deadline_guard) return;
    if (call.best && (call.best[0] < us || (call.best[0] === us && call.best[1] < sender))) return;
    call.best = [us, sender];
    call.isMine = false;
  }

  wakeCalls() {
    for (const call of this.calls.values()) {
      if (call.due !== undefined && this.isDue(call.due)) this.#bid(call);
      if (call.isMine && this.isDue(call.deadline + 10 * S)) call.isMine = false;
      if (this.now > call.deadline + 60 * S) this.calls.delete(call.key);
    }
    for (const [key, set] of this.sets) {
      if (!this.isDue(set.said + S)) continue;
      this.sets.delete(key);
      this.drop("INCOMPLETE_SET");
    }
    for (const [which, one] of this.forfeits) {
      if (!this.isDue(one.due)) continue;
      Object.assign(one, { times: one.times + 1, due: this.at(this.now + S) });
      this.report(which, "FORFEITED", 0, one.reason);
      if (one.times >= 20) this.forfeits.delete(which);
    }
  }

  #bid(call) {
    const { due } = call;
    const late = this.now >= call.deadline - 2 * this.site.us.deadline_guard;
    const able = this.mayGive && this.version && this.hasTime && !this.isAway && !this.leftOut.get(call.key)?.includes(this.node);
    if (late || !able || !this.#search(call)) return (call.due = undefined);
    if (call.due > due + 5 * MS && !this.isDue(call.due)) return undefined;
    call.due = undefined;
    const cost = Math.ceil(call.cost / MS);
    const us = cost * MS;
    if (call.best && (call.best[0] < us || (call.best[0] === us && call.best[1] < this.node))) return undefined;
    if (this.steps.length + call.steps.length + 4 > MOST_LEGS) return undefined;
    Object.assign(call, { best: [us, this.node], isMine: true, hasBid: true });
    return this.say("Bid", { initiator: call.initiator, call: call.number, cost: cost % 2 ** 32, itinerary_version: 0 });
  }

  // --- awards and tasks

  #onAward(word) {
    const which = task(word);
    const call = this.calls.get(`${word.sender} ${word.call}`);
    this.forfeits.delete(which);
    if (word.winner !== this.node || word.result !== "AWARDED") return this.#isLost(word, which);
    const one = this.tasks.get(which);
    if (one) return this.report(which, one.phase === "LOADED" ? "LOADED" : "AWARDED", one.sink);
    if (this.done.has(which)) return this.report(which, "DONE", this.done.get(which));
    const begin = call?.hasBid && this.mayTake && this.#free(call);
    const found = begin && this.planner().task(call, begin, this.freePlaces());
    if (!found) return this.forfeit(which, call?.hasBid ? "IMPOSSIBLE" : "JOURNAL_LOST");
    call.isMine = false;
    this.stamp = [call.deadline_ms, call.initiator, call.number & 0xff];
    this.take(this.kept(), call, found);
    this.publish();
    return this.report(which, "AWARDED", this.tasks.get(which).sink);
  }

  take(kept, { steps, ...call }, found) {
    this.steps = [...kept, ...found.steps];
    const { phase = "AWARDED" } = this.tasks.get(call.task) ?? {};
    this.tasks.set(call.task, { call, phase, sink: found.steps.findLast((one) => one.action === "WORK").place });
    this.save();
  }

  forfeit(which, reason) {
    this.report(which, "FORFEITED", 0, reason);
    if (reason !== "JOURNAL_LOST") this.forfeits.set(which, { reason, times: 1, due: this.now + S });
  }

  #isLost(word, which) {
    this.calls.delete(`${word.sender} ${word.call}`);
    const one = this.tasks.get(which);
    const isOver = word.result === "AWARDED" ? newer(word.task_version, 1, 7) : ["REJECTED", "WITHDRAWN"].includes(word.result);
    if (!one || one.phase !== "AWARDED" || one.call.initiator !== word.sender || !isOver) return;
    this.tasks.delete(which);
    if (this.hand?.which === which) this.hand = undefined;
    this.tokens.wanted.clear();
    this.save();
    const kept = this.inHand().filter((step) => step.call?.task !== which);
    if (this.remake()) return;
    this.steps = kept;
    this.publish();
  }

  /** All that is left is planned anew, behind the run or the work in hand; whether there is a way. */
  remake() {
    const planner = this.planner();
    const kept = this.cut(this.inHand());
    let begin = endOf(kept) ?? [this.place.track, this.place.index, this.now];
    let steps = kept;
    const tasks = [...this.tasks.values()].filter((one) => one.phase !== "LOADED" || !kept.some((step) => step.call?.task === one.call.task));
    const works = new Map();
    for (const one of tasks.filter(({ call }) => !kept.some((step) => step.call?.task === call.task))) {
      const found = planner.task({ ...one.call, isAboard: one.phase === "LOADED" }, begin, this.freePlaces(one.call));
      if (!found) return false;
      const last = found.steps.findLastIndex((step) => step.action === "WORK");
      works.set(one.call.task, found.steps[last].place);
      steps = [...steps, ...found.steps.slice(0, last + 1)];
      begin = endOf(steps);
    }
    const rest = planner.rest([begin[0], begin[1], Math.max(begin[2], this.now)]);
    if (!rest) return false;
    this.steps = [...steps, ...rest];
    for (const [which, sink] of works) this.tasks.get(which).sink = sink;
    this.publish();
    return true;
  }

  #onCar({ sender, car_origin, car_number, station, version, wheelbase_mm: wheelbase }) {
    const car = reference(car_origin, car_number);
    const known = this.cars.get(car);
    if (this.tokens.held.has(carKey(car)) || (known && known.version !== version && !newer(version, known.version, 16))) return;
    if (known && known.version === version && known.by !== sender) return;
    if (known && known.by !== sender && this.tokens.belief(carKey(car))[1] !== sender) return;
    this.cars.set(car, { station, by: sender, version, wheelbase });
    if (known?.station !== station) this.beatSoon();
  }

  // --- words

  report(which, phase, station, reason = "NONE") {
    this.say("TaskReport", { task_origin: Math.floor(which / 65_536), task_number: which % 65_536, phase, station, reason });
  }

  sayCar(car, { station, version, wheelbase }) {
    const signals = { car_origin: car >> 16, car_number: car & 0xffff, station, version, wheelbase_mm: wheelbase };
    this.say("CarAt", signals);
    return signals;
  }

  publish() {
    this.version = (this.version % 255) + 1;
    const steps = this.steps.length ? this.steps : [{ ...this.standing(), end: this.now + MS }];
    if (!this.steps.length) this.stamp = [Math.ceil(this.now / MS) % 2 ** 32, this.node, 0];
    const [award, initiator, call] = this.stamp;
    const legs = legsOf(steps, this.near(award));
    this.legs = legs;
    const head = { version: this.version, grade: "FIRM", legs: legs.length, stamp_award_ms: award, stamp_initiator: initiator, stamp_call: call };
    this.plan = [["ItineraryHead", head]];
    legs.forEach((one, leg) => {
      const [side, line] = [one.place >> 7 & 1 ? "FAR" : "NEAR", { track: one.track, from_index: one.from, to_index: one.to }];
      const end_ms = Math.max(0, Math.ceil((one.end - this.near(award)) / MS));
      this.plan.push(["ItineraryLeg", { version: this.version, action: one.action, leg, side, ...line, end_ms }]);
    });
    for (const [name, signals] of this.plan) this.say(name, signals);
    this.compare();
  }

  /** R3: all that I vouch for. */
  stateAll() {
    for (const [name, signals] of this.plan ?? []) this.say(name, signals);
    if (this.version) this.sayPlace();
    for (const [which, one] of this.tasks) this.report(which, "AWARDED", one.sink);
    for (const [car, one] of this.cars) if (one.by === this.node && this.tokens.held.has(carKey(car))) this.sayCar(car, one);
    this.tokens.state();
  }
}
