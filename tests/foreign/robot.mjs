// A robot written from docs/protocol.md, docs/site-file.md and the DBC files alone: its drive and its shuttle.
// A line in is a time with a frame or a wake, the lines out are frames, what is to be kept, and the next wake.
import { createInterface } from "node:readline";
import { Calls } from "./calls.mjs";
import { FAULTS } from "./faults.mjs";
import { MS, S, next } from "./fleet.mjs";
import { WORK, hopUs, meeting, spotOf, windowsOf, workAt } from "./plan.mjs";
import { ABOARD, ANY, gateOf, isSpur } from "./site.mjs";
import { carKey, isSegment, stationKey } from "./tokens.mjs";

const ACTIONS = { true: ["REACH", "GRIP", "RETRACT"], false: ["REACH", "RELEASE", "RETRACT"] };
const AFTER = { REACH: "REACHED", GRIP: "REACHED", RELEASE: "REACHED", RETRACT: "HOME", undefined: "REACHED HOME" };
const MARK_MM = 5; // so near to a mark it is there

export class Robot extends Calls {
  constructor(setup, kept) {
    super(setup, kept);
    const { speed_mm_s: v, acceleration_mm_s2: a } = this.site.carrier;
    [this.home] = [...this.site.homes].find(([, node]) => node === this.node);
    this.track ??= this.home >> 8;
    this.soon = Math.ceil(((v * v) / (2 * a) + 3 * v) / this.site.pitch) + 1;
    Object.assign(this, { said: { index: 0, isMoving: false, us: 0 }, needed: [], wanted: new Set() });
    this.tell("StateRequest", {});
  }

  journal() {
    return { ...super.journal(), hand: this.hand, track: this.track };
  }

  isStanding = () => this.drive.mode === "STANDING";
  isAt = (mm) => Math.abs(mm - this.drive.position_mm) <= MARK_MM;
  isRunning = () => !this.isStanding() || (this.orderUs && !this.isAt(this.driveOrder.target_mm));

  get state() {
    if (!this.plan) return "STARTING";
    if (this.isAway() || this.frozen) return "OBSTACLE";
    return this.steps.length ? "WORKING" : "IDLE";
  }

  /** On the axis that the drive speaks of: 0 is a platform, or the mouth of a spur. */
  get axisIndex() {
    const index = Math.round(this.drive.position_mm / this.site.pitch) + 1;
    return Math.min(this.site.length.get(this.track) + 1, Math.max(0, index));
  }

  get place() {
    const key = this.drive && this.site.at(this.track, this.axisIndex);
    if (isSpur(this.track) && !isSpur(key >> 8)) return key && { ...spotOf(key), key };
    return key && { track: this.track, index: this.axisIndex, key };
  }

  onDevice(word) {
    if (word.name === "ShuttleState") {
      this.shuttleOrder ??= { sequence: word.sequence };
      this.shuttle = word;
    }
    if (word.name !== "DriveState") return;
    this.driveOrder ??= { sequence: word.sequence, target_mm: word.position_mm, across: word.across };
    const before = this.track;
    if (this.drive && word.across && !isSpur(before)) this.track = this.steps[0]?.track;
    if (!word.across && isSpur(before)) this.track = this.site.spurOf(before).mouth >> 8;
    if (this.track !== before) this.save();
    Object.assign(this, { drive: word, driveUs: this.now });
    if (this.offset !== undefined && this.plan) this.#tellPlace();
  }

  // --- all that is due, in an order in which nothing waits for what comes behind it

  goOn() {
    this.wakeCalls();
    this.wanted.clear();
    const isReady = this.place && this.shuttle && (this.synced || !this.isAgain);
    if (!this.plan && !this.person && isReady) this.#start();
    if (this.isAway() || !this.synced) this.orderUs = 0;
    else if (this.plan && !this.frozen) {
      if (this.meets && this.every("give way", S)) this.#giveWay();
      this.#wakeAll();
      this.#work();
    }
    this.wakeFleet();
    this.tokens.wake(this.wanted);
  }

  /** R10: what was begun goes on. */
  #start() {
    const { which, place, takes, isBegun } = this.hand ?? {};
    const call = this.tasks.get(which) ?? [...this.tasks.values()].at(-1);
    this.sayPlace();
    this.stamp = call ? this.stampOf(call) : [this.nowMs(), this.node, 0];
    const times = { begin: this.now, end: this.now + this.site.handling(place) };
    if (isBegun) this.steps = [workAt(place, { ...times, takes, call })];
    if (!this.isAgain || !this.remake()) this.publish(this.steps);
  }

  #giveWay() {
    if (!this.tasks.size && this.meets.stamp) this.stamp = this.meets.stamp;
    if (this.remake()) this.meets = undefined;
  }

  /** What of the plan cannot be changed any more. */
  inHand() {
    const isOnLift = ({ action, track, to }) => action === "RIDE" || this.site.liftOf(this.site.at(track, to));
    const isBegun = { TRAVEL: this.steps[0] === this.begun && this.isRunning(), RIDE: true, WORK: this.hand?.isBegun };
    const isFixed = ({ action }) => isBegun[action] || this.site.liftOf(this.place.key);
    const count = this.steps.findIndex((one, n) => !(n ? isOnLift(this.steps[n - 1]) : isFixed(one)));
    return count < 0 ? this.steps : this.steps.slice(0, count);
  }

  does = { TRAVEL: (step) => this.#travel(step), RIDE: (step) => this.#ride(step), WORK: (step) => this.#handle(step) };

  #work() {
    for (let [step] = this.steps; ; [step] = this.steps) {
      const isEarly = step && this.begun !== step && !this.isDue(step.begin - 10 * MS);
      if (isEarly && step.action === "TRAVEL") return this.#travel(step, false);
      if (!step || isEarly) return this.#stand();
      if (this.begun !== step) this.#beginStep(step);
      const isOver = this.does[step.action](step);
      if (this.steps[0] === step && !isOver) return this.#isLate(step);
      if (isOver) this.#endStep(step);
    }
  }

  #beginStep(step) {
    this.begun = step;
    if (step.action !== WORK) return;
    const { place, takes, call } = step;
    const isInHand = this.hand?.which === call.task && this.hand.place === place;
    if (!isInHand) this.hand = { which: call.task, place, takes, actions: ACTIONS[takes] };
    if (takes) this.report(call.task, "STARTED", place);
  }

  /** P9: what follows begins later, or sooner where it follows at once. */
  #endStep(step) {
    this.steps.shift();
    this.wanted.clear();
    const by = this.steps.length ? this.now - this.steps[0].begin : 0;
    if (by > 500 * MS || (by < -500 * MS && this.steps[0].begin <= step.end + 10 * MS)) this.#shift(this.steps, by);
  }

  /** P9: it lasts longer, and what follows comes later. */
  #isLate(step) {
    const by = this.late();
    if (by > 2 * S) step.end += by;
    if (by > 2 * S) this.#shift(this.steps.slice(1), by);
    return this.isDue(this.now + Math.max(100 * MS, 2 * S - by));
  }

  /** P8: later as it is, so that the order stays; sooner only where nobody is in the way. */
  #shift(steps, by) {
    const shifted = steps.map((one) => ({ ...one, begin: one.begin + by, end: one.end + by }));
    const isMeeting = ({ plan }) => plan && meeting(windowsOf(this.site, shifted), plan.windows);
    if (by < 0 && this.robots.some(isMeeting)) return;
    steps.forEach((one, n) => Object.assign(one, shifted[n]));
    this.publish(this.steps);
  }

  /** By how much a step that is in hand will be over later than planned, as far as can be seen. */
  late() {
    const [step] = this.steps;
    if (!step || step !== this.begun) return 0;
    const { action, from, to, place, end } = step;
    const left_mm = Math.abs((to - 1) * this.site.pitch - this.drive.position_mm);
    const moving = (1e6 * Math.abs(this.drive.speed_mm_s)) / (2 * this.site.carrier.acceleration_mm_s2);
    const seen = moving ? this.driveUs : this.now;
    let over = end;
    if (action === WORK && !this.hand?.isBegun) over = this.now + this.site.handling(place);
    else if (action === "TRAVEL" && from === to && !this.isRunning()) over = this.now + hopUs(this.site, step);
    else if (from !== to && action === "TRAVEL") over = seen + this.site.run(left_mm) - moving;
    return Math.max(0, over - end, this.now - end);
  }

  // --- driving

  body() {
    const half = this.site.carrier.length_mm / 2;
    const [low, high] = [-half, half].map((one) => Math.round((this.drive.position_mm + one) / this.site.pitch) + 1);
    const least = isSpur(this.track) ? Math.max(0, low) : low;
    return Array.from({ length: high - least + 1 }, (_, n) => this.site.at(this.track, least + n));
  }

  #stand() {
    this.orderUs = 0;
    this.#giveBack(this.body());
  }

  /** L1, L4: the lift's word under the gate that I hold. */
  #sillWord(platform) {
    const { node } = this.site.liftOf(platform);
    const { place } = this.peers.get(node);
    const { version } = this.tokens.get(gateOf(platform));
    if (!this.tokens.holds(platform) || !this.tokens.holds(gateOf(platform))) return undefined;
    if (place?.mark === (version & 0x1fff)) return place;
    // A second after the gate came: until then its word may be on its way.
    if (this.sillVersion !== version) this.marks.set("sill", this.now + S);
    this.sillVersion = version;
    if (this.every("sill", S)) this.say("SyncRequest", { whom: node, boot_before: 0 });
    return undefined;
  }

  #mayCross(platform, track) {
    const word = this.#sillWord(platform);
    return word?.isStill && word.index === this.site.liftOf(platform).floors.indexOf(track) + 1;
  }

  /** What lies ahead of a leg, from where it is: { key, mm, across }. */
  #line({ track, from, to, mouth }) {
    const { pitch } = this.site;
    const across = Number(isSpur(track));
    const { key, index: told } = this.place;
    const at = (index) => ({ key: this.site.at(track, index), mm: (index - 1) * pitch, across });
    if (mouth !== undefined && across !== this.drive.across) {
      const isOut = !across && key !== at(to).key;
      return [{ key }, isOut ? { key: at(to).key, mm: -pitch, across: 1 } : at(to)];
    }
    const index = track === this.track ? this.axisIndex : told;
    const way = to >= index ? 1 : -1;
    return Array.from({ length: Math.abs(to - index) + 1 }, (_, n) => at(index + n * way));
  }

  /** K2, K14, K15: as far as an unbroken line of held segments leads; the rights are asked for before it begins. */
  #travel(step, isBegun = true) {
    const { site, tokens } = this;
    const { mm: goal, across } = this.#line({ ...step, mouth: undefined }).at(-1);
    const isThere = this.isStanding() && this.drive.across === across && this.isAt(goal);
    if (isBegun && isThere && this.drive.sequence === this.driveOrder.sequence) {
      this.#stand();
      return true;
    }
    const line = this.#line(step);
    const ahead = line.map(({ key }) => key);
    const front = ahead.findIndex((key, n) => n >= this.soon && site.fronts.has(key));
    const soon = ahead.slice(0, Math.min(this.soon + 4, front < 0 ? Infinity : front + 1));
    const all = this.pauseUs ? [] : this.all;
    const body = this.body();
    const platform = ahead.find((key) => site.liftOf(key));
    for (const key of all ?? [...body, ...soon]) this.wanted.add(key);
    if (this.wanted.has(platform)) this.wanted.add(gateOf(platform));
    const held = ahead.findIndex((key, n) => n && !tokens.holds(key));
    let reach = (held < 0 ? ahead.length : held) - 1;
    if (platform !== undefined && !this.#mayCross(platform, this.track)) {
      reach = platform === ahead[0] ? 0 : Math.min(reach, ahead.length - 2);
    }
    const isReady = isBegun && this.shuttle.mode === "HOME" && !this.all && body.every((key) => tokens.holds(key));
    if (isReady && line[reach].mm !== undefined && (reach || this.isRunning())) this.#driveTo(line[reach]);
    else this.orderUs = 0;
    const needed = [...body, ...ahead, ...(all ?? [])];
    this.#giveBack([...needed, ...needed.filter((key) => site.liftOf(key)).map(gateOf)], reach > 0);
    return false;
  }

  #driveTo({ mm: target_mm, across }) {
    const isNew = target_mm !== this.driveOrder.target_mm || across !== this.driveOrder.across;
    if (isNew) this.driveOrder = { sequence: next(this.driveOrder.sequence), target_mm, across };
    if (!isNew && this.orderUs && !this.isDue(this.orderUs)) return;
    this.orderUs = this.now + this.site.us.drive_refresh;
    this.isDue(this.orderUs);
    this.tell("DriveOrder", { ...this.driveOrder, speed_limit_mm_s: this.site.carrier.speed_mm_s });
  }

  /** K14: what is not needed goes to whose turn it is, else to its steward, together. */
  #giveBack(needed, isSoon = false) {
    const { site, tokens } = this;
    this.needed = needed;
    const held = new Set([this.home, ...tokens.mine().map(({ key }) => key)].filter((key) => tokens.holds(key)));
    const left = [...held].filter((key) => isSegment(key) && !needed.includes(key)).sort((a, b) => a - b);
    this.leftUs = left.length ? (this.leftUs ?? this.now) : undefined;
    const isUrgent = left.some((key) => site.fronts.has(key) || site.liftOf(key) || tokens.nextOf(key));
    if (!left.length || (isSoon && !isUrgent && left.length < 8 && !this.isDue(this.leftUs + 8 * S))) return;
    this.sayPlace();
    this.leftUs = undefined;
    const to = new Map(left.map((key) => [key, tokens.nextOf(key) || site.stewards.get(key >> 8)]));
    const lineOf = (key) => `${to.get(key)} ${gateOf(key) === key ? key : key >> 8}`;
    const lines = new Map(left.map((key) => [lineOf(key), left.filter((one) => lineOf(one) === lineOf(key))]));
    for (const keys of lines.values()) tokens.give(keys, to.get(keys[0]));
  }

  /** K13: whether an order of passing has come about; all or none where none has for long. */
  seesOrder(isSeen) {
    if (isSeen && !this.all) this.noOrderUs = undefined;
    else this.noOrderUs ??= this.now;
  }

  /** K13: all to the end of the plan, but for lifts; a part of it goes back, and is asked for again later. */
  #wakeAll() {
    const body = this.body();
    const isHeld = (key) => this.tokens.holds(key);
    if (this.pauseUs && this.isDue(this.pauseUs)) this.pauseUs = 0;
    else if (this.pauseUs) return;
    if (this.all?.every(isHeld)) [this.all, this.noOrderUs] = [undefined, undefined];
    else if (!this.all && this.noOrderUs !== undefined && this.isDue(this.noOrderUs + 5 * S)) {
      this.all = [...new Set(this.windows.map(({ key }) => key))].filter((key) => !this.site.liftOf(key));
    } else if (this.all?.some((key) => isHeld(key) && !body.includes(key))) {
      this.partUs ??= this.now;
      if (!this.isDue(this.partUs + 2 * S)) return;
      [this.pauseUs, this.partUs] = [this.now + 5 * S, undefined];
      this.#giveBack(body);
    }
  }

  /** L3, L5: it rides while the gate is away, and is there when that comes back with the lift's word. */
  #ride(step) {
    const platform = step.track << 8;
    const there = this.site.liftOf(platform).floors[step.to - 1];
    const isThere = this.#mayCross(platform, there);
    if (this.ridden !== step || (!isThere && this.#sillWord(platform))) this.#stand();
    this.ridden = step;
    this.wanted.add(gateOf(platform));
    if (!isThere) return false;
    this.track = there;
    this.save();
    this.sayPlace();
    return true;
  }

  // --- the shuttle

  /** C1, C3, U2. */
  #handle(step) {
    const { call, place, takes } = step;
    const { hand, shuttle } = this;
    const keys = [stationKey(place), carKey(call.car)];
    const mark = this.#line({ ...step, from: 0 }).at(-1);
    if (!hand.isBegun && !this.isAt(mark.mm)) return this.#driveTo(mark);
    this.#stand();
    for (const key of keys) this.wanted.add(key);
    const isFull = [...this.cars].some(([car, one]) => one.station === place && car !== call.car);
    if (!takes && isFull && !hand.isBegun) return this.#leaveElsewhere(step);
    const { action, sequence } = this.shuttleOrder;
    const isDone = AFTER[action].includes(shuttle.mode) && (!action || shuttle.sequence === sequence);
    if (!isDone || !keys.every((key) => this.tokens.holds(key))) return false;
    if (action) hand.actions = hand.actions.slice(1);
    this.shuttleOrder = { sequence };
    if (!hand.actions.length) return this.#handled(step, keys);
    const order = { action: hand.actions[0], side: place & 0x80 ? "FAR" : "NEAR", wheelbase_mm: this.#wheelbase(call) };
    this.shuttleOrder = { sequence: next(sequence), ...order };
    hand.isBegun = true;
    if (takes) call.phase = "BEGUN";
    this.save();
    this.tell("ShuttleOrder", this.shuttleOrder);
    return false;
  }

  /** C7: another car is where this one is to be left. */
  #leaveElsewhere({ call, place }) {
    const isFetch = (step) => step.action === WORK && step.place === place;
    const isFetched = this.robots.some(({ plan }) => plan?.steps.slice(plan.leg).some(isFetch));
    this.fullUs ??= this.now;
    const waitUs = !this.site.bays.has(place) ? 0 : isFetched ? 10 * S : 48 * S + 4 * this.site.us.door;
    if (!this.isDue(this.fullUs + waitUs) || !this.every("leave elsewhere", S)) return;
    call.to = ANY;
    if (this.remake()) [this.hand, this.fullUs] = [undefined, undefined];
  }

  #wheelbase = (call) => this.cars.get(call.car)?.wheelbase ?? call.wheelbase;

  #handled({ call, place, takes }, [station, car]) {
    const keeper = this.site.keeper(place);
    const one = { by: this.node, version: this.tokens.get(car).version & 0xffff, wheelbase: this.#wheelbase(call) };
    this.cars.set(call.car, { ...one, station: takes ? ABOARD : place });
    this.hand = undefined;
    call.phase = "LOADED";
    if (!takes && this.tasks.delete(call.task)) this.done.set(call.task, place);
    const said = this.sayCar(call.car, this.cars.get(call.car));
    if (!takes) this.tokens.give([car], keeper, said);
    this.tokens.give([station], keeper);
    this.report(call.task, takes ? "LOADED" : "DONE", place);
    return true;
  }

  // --- where it is

  #leg() {
    const { legs } = this.plan;
    const n = legs.indexOf(this.steps[0] ?? legs.at(-1));
    return n > 0 && this.begun !== this.steps[0] && legs[n - 1].action === "STAND" ? n - 1 : Math.max(0, n);
  }

  sayPlace() {
    const { track, index } = this.place;
    const isMouth = isSpur(this.track) && !isSpur(track);
    const offset_mm = isMouth ? 0 : this.drive.position_mm - (index - 1) * this.site.pitch;
    const where = { track, index, offset_mm, speed_mm_s: this.drive.speed_mm_s };
    this.say("Progress", { itinerary_version: this.version, leg: this.plan ? this.#leg() : 0, ...where });
    this.said = { index, isMoving: !this.isStanding(), us: this.now };
  }

  /** P10. */
  #tellPlace() {
    const { index, isMoving, us } = this.said;
    const isPast = this.place.index !== index && (!isMoving || this.now - us >= 8 * S);
    if (isPast || (this.isStanding() && isMoving)) this.sayPlace();
  }

  /** P11. */
  waits = (key, blocker, reason) => this.say("Waiting", { track: key >> 8, index: key & 0xff, blocker, reason });
}

// --- lines in and out

let robot;
for await (const line of createInterface({ input: process.stdin })) {
  const [local, kind, number, data] = line.split(" ", 4);
  if (kind === "start") {
    const [setup, journal] = JSON.parse(line.slice(line.indexOf("[")));
    robot = new Robot(setup, journal);
    FAULTS[setup.fault]?.(robot);
  }
  const bus = ["fleet", "device"].find((one) => one === kind);
  const frames = robot.step(Number(local), bus, Number(number), bus && data && Buffer.from(data.slice(1), "hex"));
  const out = frames.map(([name, id, bytes]) => `${name} ${id} ${bytes.toString("hex")}`);
  if (robot.isDirty) out.unshift(`keep ${JSON.stringify(robot.journal())}`);
  robot.isDirty = false;
  const due = robot.offset === undefined ? Infinity : robot.next - robot.offset;
  process.stdout.write(`${[...out, `wake ${due === Infinity ? -1 : due}`].join("\n")}\n`);
}
