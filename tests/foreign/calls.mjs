// Calls, bids, tasks, and what others plan (chapters 4 to 7).
import { Fleet, MS, S, newer, next } from "./fleet.mjs";
import { Planner, ROUND, WORK, endOf, floorOf, legsOf, meeting, windowsOf } from "./plan.mjs";
import { ANY, frontOf, isSpur } from "./site.mjs";
import { carKey, isSegment } from "./tokens.mjs";

const MOST_LEGS = 31;
const ALWAYS = { a: -Infinity, b: Infinity };
const reference = (origin, number) => origin * 65_536 + number;
const task = (word) => reference(word.task_origin, word.task_number);

export class Calls extends Fleet {
  constructor(setup, kept) {
    super(setup, kept);
    this.tasks = new Map(kept.tasks); // task: its call, with the phase that the task is in
    this.done = new Map(kept.done); // task: where the car was left
    this.steps = [];
    this.calls = new Map();
    this.leftOut = new Map();
    this.sets = new Map();
    this.forfeits = new Map(); // task: [reason, how often it was said]
    this.order = new Map(); // node and segment: whether it passes there before me
  }

  journal() {
    return { ...super.journal(), tasks: [...this.tasks], done: [...this.done] };
  }

  get version() {
    return this.plan?.version ?? 0;
  }

  get robots() {
    return this.others.filter((one) => this.isRobot(one));
  }

  get nowMs() {
    return Math.ceil(this.now / MS) % 2 ** 32;
  }

  /** F6. */
  near(ms) {
    const now = Math.floor(this.now / MS);
    return (now + ((ms - now) | 0)) * MS;
  }

  /** F4: the frames of a set by their places, when it is whole. */
  #collect(key, place, word, isWhole) {
    const set = this.sets.get(key) ?? { words: {} };
    const before = set.words[place];
    this.sets.delete(key);
    if (before && Object.keys(word).some((one) => one !== "senders" && before[one] !== word[one])) return undefined;
    set.words[place] = word;
    set.said = this.now;
    if (isWhole(set.words)) return set.words;
    this.sets.set(key, set);
    return undefined;
  }

  // --- what others plan, and where they are

  onItinerary(word, peer) {
    const key = `plan ${word.sender} ${word.version}`;
    if (word.name === "ItineraryLeg" && !this.sets.has(key)) return;
    const isWhole = (words) => Object.keys(words).length > words.head.legs;
    const { head, ...legs } = this.#collect(key, word.leg ?? "head", word, isWhole) ?? {};
    if (!head || head.grade === "TENTATIVE" || (peer.plan && !newer(head.version, peer.plan.version, 8))) return;
    const award = this.near(head.stamp_award_ms);
    let [begin, here] = [award, peer.place?.track];
    const steps = Object.values(legs).map(({ action, track, side, from_index: from, to_index: to, end_ms }) => {
      const end = award + end_ms * MS;
      const mouth = action === "TRAVEL" && from === to ? this.#beyond(track, to, here) : undefined;
      const step = { action, track, from, to, begin, end, mouth, place: (track << 8) | ((side === "FAR") << 7) | to };
      [begin, here] = [end, track];
      return step;
    });
    const stamp = [head.stamp_award_ms, head.stamp_initiator, head.stamp_call];
    peer.plan = { version: head.version, stamp, steps, leg: 0, windows: steps.length ? windowsOf(this.site, steps) : [] };
    if (head.grade === "RELEASED") peer.plan = undefined;
    this.compare();
  }

  /** The other side of a linked end that a leg goes over. */
  #beyond(track, index, before) {
    if (isSpur(track)) return this.site.spurOf(track).mouth;
    const isFrom = (one) => one.mouth === ((track << 8) | index) && (!isSpur(before) || one.track === before);
    const spur = this.site.spurs.find(isFrom);
    return spur && (spur.track << 8) | 1;
  }

  onProgress({ itinerary_version, leg, track, index, offset_mm, speed_mm_s }, peer) {
    const isStill = speed_mm_s === 0 && Math.abs(offset_mm) <= 5;
    const key = this.site.at(track, index);
    if (peer.place?.key !== key) peer.movedUs = this.now;
    peer.place = { track, index, key, isStill, mark: (leg << 8) | itinerary_version };
    if (peer.plan?.version !== itinerary_version) return;
    peer.plan.leg = Math.max(leg, peer.plan.leg);
    const now = peer.plan.steps[peer.plan.leg];
    const left = (one) => now?.track === track && one >> 8 === track && ((one & 0xff) - index) * Math.sign(now.to - now.from) < 0;
    peer.plan.windows = peer.plan.windows.filter((one) => one.leg > leg || (one.leg === leg && !left(one.key)));
  }

  /** J6: it stands where its plan has left. */
  hasLeft({ place, plan, movedUs, waitsUs = 0 }) {
    const here = plan.windows.filter((one) => one.key === place?.key);
    const since = Math.max(movedUs, here.at(-1)?.b ?? 0);
    return Boolean(place) && this.now > Math.min(Math.max(since, waitsUs) + 20 * S, since + 600 * S);
  }

  onBlocked({ name, sender, track, index }) {
    if (sender <= 250 && this.site.stewards.get(track) !== sender) return this.drop("NOT_AUTHORISED");
    this.blocked[name === "Blocked" ? "add" : "delete"]((track << 8) | index);
    this.beatSoon();
    return this.compare();
  }

  onClear(word) {
    this.onBlocked(word);
  }

  /** P6, J7: what the others need, and where they rest. */
  planner() {
    const busy = new Map();
    const add = (key, window) => busy.set(key, [...(busy.get(key) ?? []), window]);
    const ends = [];
    for (const one of this.robots) {
      const isIdle = !one.plan || this.isObstacle(one);
      const rights = [...this.tokens.all.values()].filter(({ key, holder }) => holder === one.node && isSegment(key));
      const windows = isIdle ? rights.map(({ key }) => ({ key, ...ALWAYS })) : one.plan.windows;
      const end = isIdle ? one.place : { track: one.plan.steps.at(-1).track, index: one.plan.steps.at(-1).to };
      if (isIdle && one.place) add(one.place.key, ALWAYS);
      for (const window of windows) add(window.key, window);
      if (end) ends.push(this.site.at(end.track, end.index));
    }
    for (const key of this.blocked) add(key, ALWAYS);
    for (const { node, track } of this.site.lifts) {
      const mine = this.steps.findLast((one) => one.track === track);
      const { place } = this.peers.get(node);
      if (mine ?? place) add(track << 8, { a: -Infinity, b: mine?.end ?? this.now, to: mine?.to ?? place.index });
    }
    return new Planner(this.site, busy, this.site.refuges(ends));
  }

  get windows() {
    return windowsOf(this.site, this.steps.length ? this.steps : [this.standing()]);
  }

  standing() {
    const { track, index } = this.place;
    return { action: "STAND", track, from: index, to: index, begin: this.now, end: this.now + MS };
  }

  /** K12: who passes a segment right before a robot, by the plans that I know; me too. */
  before(key, node) {
    const windows = (one) => (one === this.node ? this.windows : (this.peers.get(one).plan?.windows ?? []));
    const own = windows(node).find((one) => one.key === key);
    const isBefore = (other, theirs) => {
      const known = this.order.get(`${other === this.node ? node : other} ${key}`);
      const isMeeting = meeting([theirs], [own]) && known !== undefined && [node, other].includes(this.node);
      return isMeeting ? known !== (other === this.node) : theirs.a < own.a;
    };
    const others = [this.node, ...this.robots.filter((one) => !this.isObstacle(one)).map((one) => one.node)];
    const found = others.filter((one) => own && one !== node).flatMap((other) => {
      return windows(other).filter((one) => one.key === key && isBefore(other, one)).map(({ a }) => [a, other]);
    });
    return found.sort((a, b) => b[0] - a[0])[0]?.[1] ?? 0;
  }

  /** K13 asks for all or none without a plan. */
  claim(key) {
    const isPlanned = !this.all;
    return { itinerary_version: isPlanned ? this.version : 0, predecessor: isPlanned ? this.before(key, this.node) : 0 };
  }

  /** K12, K14: why a request is not served now; empty where it is. */
  objection(key, node, { plan, predecessor }) {
    const peer = this.peers.get(node);
    const isMine = !isSegment(key) || this.site.liftOf(key) || this.body().includes(key);
    const sees = this.before(key, node);
    const isNeeded = this.needed.includes(key) && (this.isRunning || sees === this.node);
    if (isMine || isNeeded || this.now - peer.heard > 1.25 * this.site.us.heartbeat) return "TOKEN_NOT_GRANTABLE_YET";
    if (plan === 0) return "";
    const isOther = predecessor !== sees && predecessor !== this.node;
    const isKnown = peer.plan && !newer(plan, peer.plan.version, 8) && !isOther;
    if (isKnown) return sees && sees !== this.node ? "TOKEN_NOT_GRANTABLE_YET" : "";
    for (const one of this.robots.filter((other) => [node, predecessor].includes(other.node))) {
      if (this.every(`view ${one.node}`, S)) this.ask(one, 0, this.now);
    }
    return "MIRROR_BEHIND";
  }

  /** P7, P8: whose plans meet mine, and whether it is I who makes it anew. */
  compare() {
    if (!this.plan || !this.place) return;
    const mine = this.windows;
    const order = new Map();
    this.meets = mine.some((one) => this.blocked.has(one.key)) ? {} : undefined;
    for (const { node, plan } of this.robots.filter((one) => one.plan && !this.isObstacle(one))) {
      const pair = meeting(mine, plan.windows);
      if (pair && this.#yields(node, plan, ...pair)) this.meets = plan;
      for (const one of mine) {
        const theirs = plan.windows.find((other) => other.key === one.key);
        const name = `${node} ${one.key}`;
        const isFirst = theirs && (meeting([one], [theirs]) ? this.order.get(name) : theirs.a < one.a);
        if (isFirst !== undefined) order.set(name, isFirst);
      }
    }
    this.order = order;
  }

  #yields(node, plan, mine, theirs) {
    const known = this.order.get(`${node} ${mine.key}`);
    const [works, theirWorks] = [this.steps, plan.steps.slice(plan.leg)].map((all) => all.some((one) => one.action === WORK));
    if (mine.b === Infinity && !this.steps.length) return true;
    if (theirs.b === Infinity && plan.windows.length === 1) return false;
    if (known !== undefined) return known;
    if (this.tokens.holds(mine.key)) return false;
    if (this.tokens.get(mine.key).holder === node) return true;
    if (works !== theirWorks) return theirWorks;
    const n = this.stamp.findIndex((one, place) => one !== plan.stamp[place]);
    return n === 0 ? newer(this.stamp[0], plan.stamp[0], 32) : this.stamp[n] > plan.stamp[n];
  }

  // --- calls and bids

  onLeftOut(word) {
    const key = `${word.sender} ${word.call}`;
    const nodes = [..."abcdef"].map((one) => word[`node_${one}`]);
    this.leftOut.set(key, [...(this.leftOut.get(key) ?? []), ...nodes]);
  }

  onCall(word) {
    const key = `${word.sender} ${word.call}`;
    const isWhole = ({ Call: head, CallTerms, CallLoad, CallParent }) => head && CallTerms && CallLoad && (!head.depth || CallParent);
    const words = this.calls.has(key) ? undefined : this.#collect(key, word.name, word, isWhole);
    if (words) this.#opened(key, words);
  }

  /** B1, B3. */
  #opened(key, { Call: head, CallTerms: terms, CallLoad: load, CallParent: parent }) {
    const { sender: initiator, call: number } = head;
    const deadline = this.near(terms.deadline_ms);
    const { call_window: window, deadline_guard: guard, door } = this.site.us;
    for (const one of [...this.calls.values()].filter((other) => other.initiator === initiator && other.task === task(head))) {
      if (deadline < one.deadline && !newer(number, one.number, 16)) return;
      this.calls.delete(one.key);
    }
    this.forfeits.delete(task(head));
    const isKnown = ["PARK", "RETRIEVE"].includes(head.operation) && head.criterion === "FINISH_TIME" && !head.depth;
    const isInTime = this.now < deadline - 2 * guard && deadline <= this.now + 60 * window;
    const { min_wheelbase_mm: least, max_wheelbase_mm: most } = this.site.cars;
    const { wheelbase_mm: wheelbase, to_station: to } = load;
    const isFit = wheelbase === 1_500 || (wheelbase >= least && wheelbase <= most);
    if (!isKnown || !isInTime || !isFit || !["ANY", "ROBOT"].includes(head.kind)) return;
    const soonest = this.site.bays.has(terms.from_station) ? deadline - window + 9_500 * MS + door : 0;
    const ready = parent?.ready_ms ? deadline + parent.ready_ms * MS : soonest;
    const car = reference(load.car_origin, load.car_number);
    const { from_station: source, deadline_ms } = terms;
    const call = { key, initiator, number, task: task(head), deadline, deadline_ms, source, to, ready, car, wheelbase };
    Object.assign(call, { floor: floorOf(this.site, call), heard: this.now });
    this.calls.set(key, call);
    this.#search(call);
  }

  /** What of the plan stays for a task behind it: all up to the last work, else the run in hand. */
  #kept() {
    const work = this.steps.findLastIndex((one) => one.action === WORK);
    return work < 0 ? this.inHand() : this.steps.slice(0, work + 1);
  }

  /** These tasks, one behind the other, behind what is kept: { steps, over }, or undefined where there is no way. */
  #arrange(kept, calls) {
    const planner = this.planner();
    const after = (steps) => {
      const { us = 0, ...where } = endOf(steps) ?? this.place;
      return { ...where, us: Math.max(us + this.late, this.now) };
    };
    let found = { steps: kept };
    for (const call of calls) {
      const { steps } = found;
      const done = steps.slice(0, Math.max(kept.length, steps.findLastIndex((one) => one.action === WORK) + 1));
      const plan = planner.task({ ...call, isAboard: call.phase === "LOADED" || kept.some((one) => one.call === call) }, after(done), this.freePlaces(done));
      if (!plan) return undefined;
      for (const one of plan.steps) if (one.call) one.call = call;
      found = { steps: [...done, ...plan.steps], over: plan.over };
    }
    const rest = calls.length ? [] : planner.rest(after(kept));
    return rest && { ...found, steps: [...found.steps, ...rest] };
  }

  freePlaces(steps) {
    const others = this.robots.flatMap((one) => one.plan?.steps ?? []);
    const works = [...steps, ...others].filter((one) => one.action === WORK).map((one) => one.place);
    const taken = new Set([...works, ...[...this.cars.values()].map((one) => one.station)]);
    return this.site.places.filter((one) => !taken.has(one) && !this.blocked.has(frontOf(one)));
  }

  /** B7: behind all that I have won and bid for. */
  #search(call) {
    const bids = [...this.calls.values()].filter((one) => one.isMine && one !== call && !this.tasks.has(one.task));
    const found = this.place && this.#arrange(this.#kept(), [...bids, call]);
    call.due = undefined;
    if (!found || found.steps.length + 4 > MOST_LEGS) return false;
    call.cost = Math.ceil(found.over / MS);
    call.due = call.heard + this.site.delay(found.over - call.floor, this.node);
    return true;
  }

  #isBeaten({ best }, us, node) {
    return best && (best[0] < us || (best[0] === us && best[1] < node));
  }

  onBid({ sender, initiator, call: number, cost }, peer) {
    const call = this.calls.get(`${initiator} ${number}`);
    if (!call || !peer || this.isObstacle(peer) || this.leftOut.get(call.key)?.includes(sender)) return;
    const us = this.near(cost);
    const isVoid = us < call.floor - 500 * MS || this.now > call.deadline - this.site.us.deadline_guard;
    if (isVoid || this.#isBeaten(call, us, sender)) return;
    Object.assign(call, { best: [us, sender], isMine: false });
  }

  #bid(call) {
    const { due } = call;
    const isLate = this.now >= call.deadline - 2 * this.site.us.deadline_guard;
    const isAble = this.mayGive() && this.plan && this.hasTime() && !this.isAway() && !this.leftOut.get(call.key)?.includes(this.node);
    call.due = undefined;
    if (isLate || !isAble || !this.#search(call)) return;
    if (call.due > due + 5 * MS && !this.isDue(call.due)) return;
    call.due = undefined;
    if (this.#isBeaten(call, call.cost * MS, this.node)) return;
    Object.assign(call, { best: [call.cost * MS, this.node], isMine: true, hasBid: true });
    this.say("Bid", { initiator: call.initiator, call: call.number, cost: call.cost % 2 ** 32, itinerary_version: 0 });
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
    for (const [which, [reason, times]] of this.forfeits) {
      if (!this.every(`forfeit ${which}`, S)) continue;
      this.report(which, "FORFEITED", 0, reason);
      this.forfeits.set(which, [reason, times + 1]);
      if (times === 20) this.forfeits.delete(which);
    }
  }

  // --- awards and tasks

  /** Where the load of a task will be. */
  #sink(which) {
    return this.steps.findLast((one) => one.call?.task === which)?.place ?? 0;
  }

  onAward(word) {
    const which = task(word);
    const call = this.calls.get(`${word.sender} ${word.call}`);
    const one = this.tasks.get(which);
    this.forfeits.delete(which);
    if (word.winner !== this.node || word.result !== "AWARDED") return this.#isLost(word, which);
    if (one) return this.report(which, one.phase === "LOADED" ? "LOADED" : "AWARDED", this.#sink(which));
    if (this.done.has(which)) return this.report(which, "DONE", this.done.get(which));
    const found = call?.hasBid && this.mayTake() && this.#arrange(this.#kept(), [call]);
    if (!found) return this.forfeit(which, call?.hasBid ? "IMPOSSIBLE" : "JOURNAL_LOST");
    Object.assign(call, { isMine: false, phase: "AWARDED" });
    this.stamp = [call.deadline_ms, call.initiator, call.number & 0xff];
    this.tasks.set(which, call);
    this.#take(found);
    return this.report(which, "AWARDED", this.#sink(which));
  }

  #take({ steps }) {
    this.steps = steps;
    this.save();
    this.publish();
  }

  /** U5. */
  forfeit(which, reason) {
    this.report(which, "FORFEITED", 0, reason);
    if (reason === "JOURNAL_LOST") return;
    this.every(`forfeit ${which}`, S);
    this.forfeits.set(which, [reason, 1]);
  }

  /** U6. */
  #isLost(word, which) {
    this.calls.delete(`${word.sender} ${word.call}`);
    const one = this.tasks.get(which);
    const isOver = word.result === "AWARDED" ? newer(word.task_version, 1, 7) : ["REJECTED", "WITHDRAWN"].includes(word.result);
    if (!one || one.phase !== "AWARDED" || one.initiator !== word.sender || !isOver) return;
    this.tasks.delete(which);
    if (this.hand?.which === which) this.hand = undefined;
    if (!this.remake()) this.#take({ steps: this.inHand().filter((step) => step.call?.task !== which) });
  }

  /** All that is left is planned anew, behind the run or the work in hand; whether there is a way. */
  remake() {
    const kept = this.cut(this.inHand());
    const found = this.#arrange(kept, [...this.tasks.values()].filter((one) => !this.isDoneBy(one, kept)));
    if (found) this.#take(found);
    return Boolean(found);
  }

  isDoneBy(call, steps) {
    return steps.some((one) => one.call === call && !one.takes);
  }

  onCarAt({ sender, car_origin, car_number, station, version, wheelbase_mm: wheelbase }) {
    const car = reference(car_origin, car_number);
    const known = this.cars.get(car);
    const { holder } = this.tokens.get(carKey(car));
    const isOld = known && (known.version === version ? known.by !== sender : !newer(version, known.version, 16));
    if (isOld || holder === this.node || (known && known.by !== sender && holder !== sender)) return;
    this.cars.set(car, { station, by: sender, version, wheelbase });
    if (known?.station !== station) this.beatSoon();
  }

  // --- words

  report(which, phase, station, reason = "NONE") {
    this.say("TaskReport", { task_origin: which >> 16, task_number: which & 0xffff, phase, station, reason });
  }

  sayCar(car, { station, version, wheelbase }) {
    const signals = { car_origin: car >> 16, car_number: car & 0xffff, station, version, wheelbase_mm: wheelbase };
    this.say("CarAt", signals);
    return signals;
  }

  /** P1, J5. */
  publish() {
    const version = next(this.version);
    if (!this.steps.length) this.stamp = [this.nowMs, this.node, 0];
    const [award, initiator, call] = this.stamp;
    const legs = legsOf(this.steps.length ? this.steps : [this.standing()], this.near(award));
    const stamp = { stamp_award_ms: award, stamp_initiator: initiator, stamp_call: call };
    const lines = legs.map((one, leg) => {
      const [side, line] = [one.place & 0x80 ? "FAR" : "NEAR", { track: one.track, from_index: one.from, to_index: one.to }];
      const end_ms = Math.max(0, Math.ceil((one.end - this.near(award)) / MS));
      return ["ItineraryLeg", { version, action: one.action, leg, side, ...line, end_ms }];
    });
    this.plan = { version, legs, words: [["ItineraryHead", { version, grade: "FIRM", legs: legs.length, ...stamp }], ...lines] };
    for (const [name, signals] of this.plan.words) this.say(name, signals);
    this.compare();
  }

  /** R3: all that I vouch for. */
  stateAll() {
    for (const [name, signals] of this.plan?.words ?? []) this.say(name, signals);
    if (this.plan) this.sayPlace();
    for (const which of this.tasks.keys()) this.report(which, "AWARDED", this.#sink(which));
    const mine = [...this.cars].filter(([car, one]) => one.by === this.node && this.tokens.holds(carKey(car)));
    for (const [car, one] of mine) this.sayCar(car, one);
    this.tokens.state();
  }
}
