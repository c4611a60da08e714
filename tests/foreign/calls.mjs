// Calls, bids, tasks, and what others plan (chapters 4 to 7).
import { Fleet, MS, S, newer, next } from "./fleet.mjs";
import { Planner, WORK, endOf, floorOf, legsOf, meeting, windowsOf } from "./plan.mjs";
import { ANY, frontOf, isSpur } from "./site.mjs";
import { carKey, isSegment } from "./tokens.mjs";

const MOST_LEGS = 31;
const ALWAYS = { a: -Infinity, b: Infinity };
const reference = (origin, number) => origin * 65_536 + number;
const taskOf = (word) => reference(word.task_origin, word.task_number);
const isBeaten = ({ best }, us, node) => best && (best[0] < us || (best[0] === us && best[1] < node));

export class Calls extends Fleet {
  constructor(setup, kept) {
    super(setup, kept);
    this.tasks = new Map(kept.tasks); // task: its call, with the phase that the task is in
    this.done = new Map(kept.done); // task: where the car was left
    this.forfeits = new Map(); // task: [reason, how often it was said]
    this.order = new Map(); // node and segment: whether it passes there before me
    Object.assign(this, { steps: [], calls: new Map(), leftOut: new Map(), sets: new Map() });
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

  get windows() {
    return windowsOf(this.site, this.steps.length ? this.steps : [this.standing()]);
  }

  nowMs = () => Math.ceil(this.now / MS) % 2 ** 32;
  stampOf = (call) => [call.deadline_ms, call.initiator, call.number & 0xff];
  /** F6. */
  near = (ms) => (Math.floor(this.now / MS) + ((ms - Math.floor(this.now / MS)) | 0)) * MS;

  /** F4: the frames of a set by their places, when it is whole. */
  #collect(key, place, word, isWhole) {
    const { words } = this.sets.get(key) ?? { words: {} };
    const isOther = Object.keys(words[place] ?? {}).some((one) => one !== "senders" && words[place][one] !== word[one]);
    this.sets.delete(key);
    words[place] = word;
    if (!isOther && isWhole(words)) return words;
    if (!isOther) this.sets.set(key, { words, said: this.now });
    return undefined;
  }

  // --- what others plan, and where they are

  onItinerary(word, peer) {
    const key = `plan ${word.sender} ${word.version}`;
    if (word.name === "ItineraryLeg" && !this.sets.has(key)) return;
    const isWhole = (words) => Object.keys(words).length > words.head.legs;
    const { head, ...legs } = this.#collect(key, word.leg ?? "head", word, isWhole) ?? {};
    if (!head || head.grade === "TENTATIVE" || !this.#isNews(head.version, peer)) return;
    peer.wasSilent = false;
    const award = this.near(head.stamp_award_ms);
    const steps = [];
    for (const { action, track, side, from_index: from, to_index: to, end_ms } of Object.values(legs)) {
      const before = steps.at(-1) ?? { end: award, track: peer.place?.track };
      const mouth = action === "TRAVEL" && from === to ? this.#beyond(track, to, before.track) : undefined;
      const place = (track << 8) | ((side === "FAR") << 7) | to;
      steps.push({ action, track, from, to, begin: before.end, end: award + end_ms * MS, mouth, place });
    }
    const stamp = [head.stamp_award_ms, head.stamp_initiator, head.stamp_call];
    const windows = steps.length && windowsOf(this.site, steps);
    peer.plan = windows ? { version: head.version, stamp, steps, windows, leg: 0 } : undefined;
    this.compare();
  }

  /** P1: of who was silent the next plan counts whatever its version. */
  #isNews = (version, { plan, wasSilent }) =>
    !plan || newer(version, plan.version, 8) || (wasSilent && version !== plan.version);

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
    const now = peer.plan.steps[peer.plan.leg] ?? {};
    const isHere = (one) => now.track === track && one >> 8 === track;
    const isOver = isStill && now.action === "TRAVEL" && isHere(key) && now.to === index;
    const isBehind = (one) => isHere(one) && ((one & 0xff) - index) * (now.to - now.from) < 0;
    const isLeft = (one) => (isOver ? one !== key : isBehind(one));
    peer.plan.windows = peer.plan.windows.filter((one) => one.leg > leg || (one.leg === leg && !isLeft(one.key)));
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

  onClear = (word) => this.onBlocked(word);

  /** P6, J7: what the others need, and where they rest. */
  planner() {
    const busy = new Map([...this.blocked].map((key) => [key, [ALWAYS]]));
    const add = (key, window) => busy.set(key, [...(busy.get(key) ?? []), window]);
    const ends = [];
    for (const one of this.robots) {
      const isIdle = !one.plan || this.isObstacle(one);
      const rights = [...this.tokens.all.values()].filter(({ key, holder }) => holder === one.node && isSegment(key));
      const body = one.place ? [one.place] : [];
      const end = isIdle ? body[0] : endOf(one.plan.steps);
      const windows = isIdle ? [...rights, ...body].map(({ key }) => ({ key, ...ALWAYS })) : one.plan.windows;
      for (const window of windows) add(window.key, window);
      if (end) ends.push(this.site.at(end.track, end.index));
    }
    for (const { node, track } of this.site.lifts) {
      const mine = this.steps.findLast((one) => one.track === track);
      const { place } = this.peers.get(node);
      if (mine ?? place) add(track << 8, { a: -Infinity, b: mine?.end ?? this.now, to: mine?.to ?? place.index });
    }
    return new Planner(this.site, busy, this.site.refuges(ends));
  }

  standing() {
    const { track, index } = this.place;
    return { action: "STAND", track, from: index, to: index, begin: this.now, end: this.now + MS };
  }

  /** K12: who passes a segment right before a robot, by the plans that I know; me too. */
  before(key, node) {
    const all = [this, ...this.robots.filter((one) => one.plan && !this.isObstacle(one))];
    const windows = (one) => (one === this ? this.windows : one.plan.windows).filter((other) => other.key === key);
    const own = all.filter((one) => one.node === node).flatMap(windows)[0];
    const others = all.filter((one) => own && one.node !== node);
    const found = others.flatMap((one) => windows(one).filter(({ a }) => a < own.a).map(({ a }) => [a, one.node]));
    return found.sort((a, b) => b[0] - a[0])[0]?.[1] ?? 0;
  }

  /** K13 asks for all or none without a plan. */
  claim(key) {
    return this.all ? {} : { itinerary_version: this.version, predecessor: this.before(key, this.node) };
  }

  /** K12, K14: why a request is not served now; empty where it is. */
  objection(key, node, { plan, predecessor }) {
    const peer = this.peers.get(node);
    const isMine = !isSegment(key) || this.site.liftOf(key) || this.body().includes(key);
    const sees = this.before(key, node);
    const isNeeded = this.needed.includes(key) && (this.isRunning() || sees === this.node);
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
    this.meets = mine.some((one) => this.blocked.has(one.key)) ? {} : undefined;
    for (const { node, plan } of this.robots.filter((one) => one.plan && !this.isObstacle(one))) {
      const pair = meeting(mine, plan.windows);
      if (pair && this.#yields(node, plan, ...pair)) this.meets = plan;
      for (const one of mine) {
        const theirs = plan.windows.find((other) => other.key === one.key);
        const isAgreed = theirs && !meeting([one], [theirs]);
        if (isAgreed) this.order.set(`${node} ${one.key}`, theirs.a < one.a);
        else if (!theirs) this.order.delete(`${node} ${one.key}`);
      }
    }
  }

  #yields(node, plan, mine, theirs) {
    const known = this.order.get(`${node} ${mine.key}`);
    const isWork = (steps) => steps.some((one) => one.action === WORK);
    const theirWorks = isWork(plan.steps.slice(plan.leg));
    if (mine.b === Infinity && !this.steps.length) return true;
    if (theirs.b === Infinity && plan.windows.length === 1) return false;
    if (known !== undefined) return known;
    if (this.tokens.holds(mine.key)) return false;
    if (this.tokens.get(mine.key).holder === node) return true;
    if (isWork(this.steps) !== theirWorks) return theirWorks;
    const n = this.stamp.findIndex((one, place) => one !== plan.stamp[place]);
    return n === 0 ? newer(this.stamp[0], plan.stamp[0], 32) : this.stamp[n] > plan.stamp[n];
  }

  // --- calls and bids

  onLeftOut(word) {
    const key = `${word.sender} ${word.call}`;
    this.leftOut.set(key, [...(this.leftOut.get(key) ?? []), ...[..."abcdef"].map((one) => word[`node_${one}`])]);
  }

  isOut = (call, node) => this.leftOut.get(call.key)?.includes(node);

  onCall(word) {
    const key = `${word.sender} ${word.call}`;
    const isWhole = ({ Call: head, CallTerms, CallLoad, CallParent }) => {
      return head && CallTerms && CallLoad && (!head.depth || CallParent);
    };
    const words = this.calls.has(key) ? undefined : this.#collect(key, word.name, word, isWhole);
    if (words) this.#opened(key, words);
  }

  /** B1, B3. */
  #opened(key, { Call: head, CallTerms: terms, CallLoad: load, CallParent: parent }) {
    const { call_window: window, deadline_guard: guard, door } = this.site.us;
    const { min_wheelbase_mm: least, max_wheelbase_mm: most } = this.site.cars;
    const [initiator, number, task, deadline] = [head.sender, head.call, taskOf(head), this.near(terms.deadline_ms)];
    const isSame = (one) => one.initiator === initiator && one.task === task;
    for (const one of [...this.calls.values()].filter(isSame)) {
      if (deadline < one.deadline && !newer(number, one.number, 16)) return;
      this.calls.delete(one.key);
    }
    this.forfeits.delete(task);
    const soonest = this.site.bays.has(terms.from_station) ? deadline - window + 9_500 * MS + door : 0;
    const ready = parent?.ready_ms ? deadline + parent.ready_ms * MS : soonest;
    const { wheelbase_mm: wheelbase, to_station: to } = load;
    const car = reference(load.car_origin, load.car_number);
    const { from_station: source, deadline_ms } = terms;
    const isTask = /PARK|RETRIEVE/.test(head.operation) && !head.depth;
    const isKnown = isTask && head.criterion === "FINISH_TIME" && /ANY|ROBOT/.test(head.kind);
    const isInTime = this.now < deadline - 2 * guard && deadline <= this.now + 60 * window;
    const isFit = wheelbase === 1_500 || (wheelbase >= least && wheelbase <= most);
    if (!isKnown || !isInTime || !isFit) return;
    const call = { key, initiator, number, task, deadline, deadline_ms, source, to, ready, car, wheelbase };
    Object.assign(call, { heard: this.now, floor: floorOf(this.site, call) });
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
      return { ...where, us: Math.max(us + this.late(), this.now) };
    };
    let found = { steps: kept };
    for (const call of calls) {
      const { steps } = found;
      const done = steps.slice(0, Math.max(kept.length, steps.findLastIndex((one) => one.action === WORK) + 1));
      const isAboard = call.phase === "LOADED" || kept.some((one) => one.call === call);
      const plan = planner.task({ ...call, isAboard }, after(done), this.freePlaces(done));
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

  onBid({ sender, initiator, call: number, cost }, peer) {
    const call = this.calls.get(`${initiator} ${number}`);
    if (!call || !peer || this.isObstacle(peer) || this.isOut(call, sender)) return;
    const us = this.near(cost);
    const isVoid = us < call.floor - 500 * MS || this.now > call.deadline - this.site.us.deadline_guard;
    if (!isVoid && !isBeaten(call, us, sender)) Object.assign(call, { best: [us, sender], isMine: false });
  }

  #bid(call) {
    const { due } = call;
    const isLate = this.now >= call.deadline - 2 * this.site.us.deadline_guard;
    const isAble = this.mayGive() && this.plan && this.hasTime() && !this.isAway() && !this.isOut(call, this.node);
    call.due = undefined;
    if (isLate || !isAble || !this.#search(call)) return;
    if (call.due > due + 5 * MS && !this.isDue(call.due)) return;
    call.due = undefined;
    if (isBeaten(call, call.cost * MS, this.node)) return;
    Object.assign(call, { best: [call.cost * MS, this.node], isMine: true, hasBid: true });
    this.say("Bid", { initiator: call.initiator, call: call.number, cost: call.cost % 2 ** 32 });
  }

  wakeCalls() {
    for (const call of this.calls.values()) {
      if (call.due !== undefined && this.isDue(call.due)) this.#bid(call);
      if (call.isMine && this.isDue(call.deadline + 10 * S)) call.isMine = false;
      if (this.now > call.deadline + 60 * S) this.calls.delete(call.key);
    }
    for (const [key, set] of this.sets) {
      if (this.isDue(set.said + S) && this.sets.delete(key)) this.drop("INCOMPLETE_SET");
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
  #sink = (which) => this.steps.findLast((one) => one.call?.task === which)?.place ?? 0;

  onAward(word) {
    const which = taskOf(word);
    const call = this.calls.get(`${word.sender} ${word.call}`);
    const one = this.tasks.get(which);
    this.forfeits.delete(which);
    if (word.winner !== this.node || word.result !== "AWARDED") return this.#isLost(word, which);
    if (call) call.isMine = false;
    if (one) return this.report(which, one.phase === "LOADED" ? "LOADED" : "AWARDED", this.#sink(which));
    if (this.done.has(which)) return this.report(which, "DONE", this.done.get(which));
    const found = call?.hasBid && this.mayTake() && this.#arrange(this.#kept(), [call]);
    if (!found) return this.forfeit(which, call?.hasBid ? "IMPOSSIBLE" : "JOURNAL_LOST");
    call.phase = "AWARDED";
    this.stamp = this.stampOf(call);
    this.tasks.set(which, call);
    this.publish(found.steps);
    return this.report(which, "AWARDED", this.#sink(which));
  }

  /** U5. */
  forfeit(which, reason) {
    this.report(which, "FORFEITED", 0, reason);
    this.every(`forfeit ${which}`, S);
    if (reason !== "JOURNAL_LOST") this.forfeits.set(which, [reason, 1]);
  }

  /** U6. */
  #isLost(word, which) {
    this.calls.delete(`${word.sender} ${word.call}`);
    const one = this.tasks.get(which);
    const isOver = word.result === "AWARDED" ? newer(word.task_version, 1, 7) : /REJECTED|WITHDRAWN/.test(word.result);
    if (!isOver || one?.phase !== "AWARDED" || one.initiator !== word.sender) return;
    this.tasks.delete(which);
    if (this.hand?.which === which) this.hand = undefined;
    if (!this.remake()) this.publish(this.inHand().filter((step) => step.call?.task !== which));
  }

  /** All that is left is planned anew, behind the run or the work in hand; whether there is a way. */
  remake() {
    const kept = this.inHand();
    const isLeft = (call) => !kept.some((one) => one.call === call && !one.takes);
    const found = this.#arrange(kept, [...this.tasks.values()].filter(isLeft));
    if (found) this.publish(found.steps);
    return Boolean(found);
  }

  onCarAt({ sender, car_origin, car_number, station, version, wheelbase_mm: wheelbase }) {
    const car = reference(car_origin, car_number);
    const known = this.cars.get(car);
    const { holder } = this.tokens.get(carKey(car));
    if (known?.by === sender) known.lacks = 0;
    const isOld = known && (known.version === version ? known.by !== sender : !newer(version, known.version, 16));
    if (isOld || holder === this.node || (known && known.by !== sender && holder !== sender)) return;
    this.cars.set(car, { station, by: sender, version, wheelbase, lacks: 0 });
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
  publish(steps) {
    const version = next(this.version);
    this.steps = steps;
    this.save();
    if (!this.steps.length) this.stamp = [this.nowMs(), this.node, 0];
    const [stamp_award_ms, stamp_initiator, stamp_call] = this.stamp;
    const award = this.near(stamp_award_ms);
    const legs = legsOf(this.steps.length ? this.steps : [this.standing()], award);
    const head = { version, grade: "FIRM", legs: legs.length, stamp_award_ms, stamp_initiator, stamp_call };
    const lines = legs.map(({ action, track, from: from_index, to: to_index, place, end }, leg) => {
      const end_ms = Math.max(0, Math.ceil((end - award) / MS));
      return { version, action, leg, side: place & 0x80 ? "FAR" : "NEAR", track, from_index, to_index, end_ms };
    });
    this.plan = { version, legs, words: [["ItineraryHead", head], ...lines.map((one) => ["ItineraryLeg", one])] };
    this.#sayPlan();
    this.compare();
  }

  #sayPlan() {
    for (const [name, signals] of this.plan.words) this.say(name, signals);
  }

  /** R3: all that I vouch for. */
  stateAll() {
    if (this.plan) this.#sayPlan();
    if (this.plan) this.sayPlace();
    for (const which of this.tasks.keys()) this.report(which, "AWARDED", this.#sink(which));
    const mine = [...this.cars].filter(([car, one]) => one.by === this.node && this.tokens.holds(carKey(car)));
    for (const [car, one] of mine) this.sayCar(car, one);
    this.tokens.state();
  }
}
