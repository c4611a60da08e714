// A robot written from docs/protocol.md, docs/site-file.md and the DBC files alone: what it does with drive and shuttle.
// One process: a line in is a time with a frame or a wake, the lines out are frames, what is to be kept, and the next wake.
import { readSync, writeSync } from "node:fs";
import { Calls } from "./calls.mjs";
import { FAULTS } from "./faults.mjs";
import { hopUs, meeting, windowsOf } from "./plan.mjs";
import { ABOARD, ANY, GATE } from "./site.mjs";
import { carKey, stationKey } from "./tokens.mjs";

const [S, MS] = [1_000_000, 1_000];
const ACTIONS = { true: ["REACH", "GRIP", "RETRACT"], false: ["REACH", "RELEASE", "RETRACT"] };
const AFTER = { REACH: "REACHED", GRIP: "REACHED", RELEASE: "REACHED", RETRACT: "HOME" };
const RESTS = ["HOME", "REACHED"];
const gateOf = (platform) => platform | GATE;

export class Robot extends Calls {
  constructor(setup, journal) {
    super(setup, journal);
    this.hand = journal.hand; // the work in hand: { which, place, takes, actions }
    const [home] = [...this.site.homes].find(([, node]) => node === this.node);
    const [held] = [...this.tokens.held.keys()].filter((key) => key < 128 << 8);
    this.track = journal.track ?? (held ?? home) >> 8;
    const { speed_mm_s: v, acceleration_mm_s2: a } = this.site.carrier;
    this.soon = Math.ceil((Math.floor((v * v) / (2 * a)) + 3 * v) / this.site.pitch) + 1;
    this.said = { index: 0, isMoving: false, us: 0 };
    this.retryUs = 0;
    this.tell("StateRequest", {});
  }

  journal() {
    return { ...super.journal(), hand: this.hand, track: this.track };
  }

  get state() {
    if (!this.version) return "STARTING";
    if (this.isAway || this.frozen) return "OBSTACLE";
    return this.steps.length ? "WORKING" : "IDLE";
  }

  get place() {
    if (!this.drive) return undefined;
    const index = this.axisIndex;
    const key = this.site.at(this.track, index);
    if (this.track >= 192 && index === 0) return { track: key >> 8, index: key & 0xff, key };
    return { track: this.track, index, key };
  }

  /** On the axis that the drive speaks of: 0 is a platform, or the mouth of a spur. */
  get axisIndex() {
    const index = Math.round(this.drive.position_mm / this.site.pitch) + 1;
    return Math.min(this.site.length.get(this.track) + 1, Math.max(0, index));
  }

  get isRunning() {
    const isOrdered = this.orderUs !== undefined && Math.abs(this.driveOrder.target_mm - this.drive.position_mm) > 5;
    return isOrdered || this.drive.mode !== "STANDING";
  }

  onDevice(word) {
    if (word.name === "DriveState") {
      this.driveOrder ??= { sequence: word.sequence, target_mm: word.position_mm, across: word.across };
      const [across, spur] = [this.track >= 192, this.steps[0]?.track];
      if (this.drive && word.across && !across) this.track = spur;
      if (!word.across && across) this.track = this.site.spurs[this.track - 192].mouth >> 8;
      if (across !== this.track >= 192) this.save();
      this.drive = word;
      this.driveUs = this.now;
      if (this.offset !== undefined && this.version) this.#tellPlace();
    } else if (word.name === "ShuttleState") {
      this.shuttleOrder ??= { sequence: word.sequence };
      this.shuttle = word;
    }
  }

  // --- all that is due, in an order in which nothing waits for what comes behind it

  goOn() {
    this.wakeCalls();
    if (!this.version && !this.person && this.place && this.shuttle && (this.synced || !this.isAgain)) this.#start();
    if (this.isAway || !this.synced) this.tokens.wanted.clear(), (this.orderUs = undefined);
    else if (this.version && !this.frozen) {
      if (this.meets && this.isDue(this.retryUs)) this.#giveWay();
      this.#wakeAll();
      this.#work();
    }
    this.wakeFleet();
  }

  #start() {
    this.sayPlace();
    if (this.hand || this.tasks.size) {
      const { call } = this.tasks.get(this.hand?.which) ?? [...this.tasks.values()].at(-1);
      this.stamp = [call.deadline_ms, call.initiator, call.number & 0xff];
      if (this.remake()) return;
    }
    this.publish();
  }

  #giveWay() {
    this.retryUs = this.now + S;
    if (!this.tasks.size && this.meets.stamp) this.stamp = this.meets.stamp;
    if (this.remake()) this.meets = undefined;
  }

  /** What of the plan cannot be changed any more. */
  inHand() {
    const [step] = this.steps;
    const { which, place, takes } = this.hand ?? {};
    if (this.hand && step?.action !== "WORK" && this.hand.isBegun) {
      const [index, end] = [place & 0x7f, this.now + this.site.handling(place)];
      return [{ action: "WORK", track: place >> 8, from: index, to: index, begin: this.now, end, place, takes, call: this.tasks.get(which).call }];
    }
    const isFixed = { TRAVEL: step === this.begun && this.isRunning, RIDE: true, WORK: this.hand?.isBegun };
    let count = Number(Boolean(step && isFixed[step.action]));
    if (step && this.site.liftOf(this.place.key)) count = Math.max(count, 1);
    const onLift = ({ action, track, to }) => action === "RIDE" || this.site.liftOf(this.site.at(track, to));
    while (count && count < this.steps.length && onLift(this.steps[count - 1])) count += 1;
    return this.steps.slice(0, count);
  }

  /** A run that may end sooner ends where its order of now does. */
  cut([step, ...more]) {
    const to = step?.action === "TRAVEL" && !this.site.liftOf(this.place.key) && Math.round(this.driveOrder.target_mm / this.site.pitch) + 1;
    if (!to || to === step.to || step.from === step.to) return step ? [step, ...more] : [];
    this.begun = { ...step, to, end: Math.max(this.now, step.begin + this.site.run(Math.abs(to - step.from) * this.site.pitch)) };
    return [this.begun];
  }

  #work() {
    for (let n = 0; n < 40; n++) {
      const [step] = this.steps;
      if (!step) return this.#stand();
      if (step.begin > this.now + 10 * MS && this.begun !== step) {
        this.#stand();
        return this.isDue(step.begin);
      }
      if (this.begun !== step) this.#beginStep(step);
      const isOver = step.action === "TRAVEL" ? this.#travel(step) : step.action === "RIDE" ? this.#ride(step) : this.#handle(step);
      if (this.steps[0] !== step) continue;
      if (!isOver) {
        const by = this.#over(step) - step.end;
        if (by > 2 * S) this.#late(step, by);
        return this.isDue(this.now + Math.max(100 * MS, 2 * S - by));
      }
      this.steps.shift();
      const by = this.steps.length ? this.now - this.steps[0].begin : 0;
      const isNext = this.steps.length > 0 && this.steps[0].begin <= step.end + 10 * MS;
      if (by > 500 * MS || (by < -500 * MS && isNext)) this.#shift(by);
    }
    return undefined;
  }

  /** P9: what follows begins later, or sooner where nobody is in the way then. */
  #shift(by) {
    const shifted = this.steps.map((one) => ({ ...one, begin: one.begin + by, end: one.end + by }));
    const windows = windowsOf(this.site, shifted);
    if (by < 0 && this.robots.some((one) => one.plan && meeting(windows, one.plan.windows))) return;
    this.steps = shifted;
    this.publish();
  }

  #beginStep(step) {
    this.begun = step;
    if (step.action !== "WORK") return;
    const which = step.call.task;
    if (this.hand?.which !== which || this.hand.place !== step.place) this.hand = { which, place: step.place, takes: step.takes, actions: [...ACTIONS[step.takes]] };
    if (step.takes) this.report(which, "STARTED", step.place);
  }

  /** When a step that is in hand will be over, as far as can be seen. */
  #over(step) {
    const { action, from, to, place, end } = step;
    if (action === "WORK") return !this.hand.isBegun ? this.now + this.site.handling(place) : Math.max(end, this.now);
    if (action === "TRAVEL" && from === to && !this.isRunning) return this.now + hopUs(this.site, step);
    if (action !== "TRAVEL" || from === to) return Math.max(end, this.now);
    const { speed_mm_s: v, acceleration_mm_s2: a } = this.site.carrier;
    const [mm, speed] = [Math.abs((to - 1) * this.site.pitch - this.drive.position_mm), Math.abs(this.drive.speed_mm_s)];
    const top = Math.min(v, Math.sqrt(a * mm + (speed * speed) / 2)) || 1;
    const ramps = (2 * top * top - speed * speed) / (2 * a);
    return Math.max(this.now, (this.drive.mode === "STANDING" ? this.now : this.driveUs) + Math.ceil(1e6 * ((2 * top - speed) / a + Math.max(0, mm - ramps) / top)));
  }

  get late() {
    const [step] = this.steps;
    return step && step === this.begun ? Math.max(0, this.#over(step) - step.end) : 0;
  }

  /** P9: it lasts longer, and what follows comes later. */
  #late(step, by) {
    const later = this.steps.map((one) => ({ ...one, begin: one.begin + by, end: one.end + by }));
    later[0].begin = step.begin;
    this.steps = later;
    [this.begun] = later;
    this.publish();
  }

  // --- driving

  #segment(index) {
    return this.site.at(this.track, index);
  }

  body() {
    const half = this.site.carrier.length_mm / 2;
    const [low, high] = [-half, half].map((one) => Math.round((this.drive.position_mm + one) / this.site.pitch) + 1);
    const least = this.track >= 192 ? Math.max(0, low) : low;
    return Array.from({ length: high - least + 1 }, (_, n) => this.#segment(least + n));
  }

  #stand(needed = []) {
    this.orderUs = undefined;
    this.#giveBack([...this.body(), ...needed]);
  }

  /** L1, L4, L5: whether the sill of a lift may be crossed here. */
  #mayCross(platform) {
    const lift = this.site.liftOf(platform);
    const { stop } = this.peers.get(lift.node);
    const gate = gateOf(platform);
    if (!this.tokens.holds(platform) || !this.tokens.holds(gate)) return false;
    const isSaid = stop?.mark === (this.tokens.version(gate) & 0x1fff);
    if (!isSaid && this.isDue(this.sillUs ?? 0)) {
      this.sillUs = this.now + S;
      if (this.sillGate === gate) this.say("SyncRequest", { whom: lift.node, boot_before: 0 });
      this.sillGate = gate;
      this.isDue(this.sillUs);
    }
    return isSaid && stop.isStill && stop.index === lift.floors.indexOf(this.track) + 1;
  }

  /** What lies ahead of a leg, from where it is: { key, mm, across }. */
  #line({ track, from, to, mouth }) {
    const { pitch } = this.site;
    const { key } = this.place;
    const index = track === this.track ? this.axisIndex : this.place.index;
    const across = Number(track >= 192);
    if (mouth !== undefined && across !== this.drive.across) {
      const end = { key: this.site.at(track, to), mm: (to - 1) * pitch, across };
      const isOut = !across && key !== end.key;
      return [{ key }, isOut ? { key: end.key, mm: -pitch, across: 1 } : end];
    }
    const way = to >= index ? 1 : -1;
    const at = (n) => ({ key: this.site.at(track, index + n * way), mm: (index + n * way - 1) * pitch, across });
    return Array.from({ length: Math.abs(to - index) + 1 }, (_, n) => at(n));
  }

  /** K2, K14, K15: as far as an unbroken line of held segments leads. */
  #travel(step) {
    const [goal, across] = [(step.to - 1) * this.site.pitch, Number(step.track >= 192)];
    const isStill = this.drive.mode === "STANDING" && this.drive.sequence === this.driveOrder.sequence;
    if (isStill && this.drive.across === across && Math.abs(this.drive.position_mm - goal) <= 5) {
      this.#stand();
      return true;
    }
    const line = this.#line(step);
    const ahead = line.map(({ key }) => key);
    const front = ahead.findIndex((key, n) => n >= this.soon && this.site.fronts.has(key));
    const wanted = this.pauseUs ? [] : this.all ?? [...this.body(), ...ahead.slice(0, front < 0 ? this.soon + 4 : Math.min(this.soon + 4, front + 1))];
    const platform = ahead.find((key) => this.site.liftOf(key));
    if (platform !== undefined && wanted.includes(platform)) wanted.push(gateOf(platform));
    for (const key of new Set(wanted)) this.tokens.want(key);
    const isHome = this.shuttle.mode === "HOME" && !this.all && this.body().every((key) => this.tokens.holds(key));
    let reach = 0;
    while (reach + 1 < ahead.length && this.tokens.holds(ahead[reach + 1])) reach += 1;
    if (platform !== undefined && !this.#mayCross(platform)) reach = platform === ahead[0] ? 0 : Math.min(reach, ahead.length - 2);
    if (isHome && line[reach].mm !== undefined && (reach || this.isRunning)) this.#driveTo(line[reach]);
    else this.orderUs = undefined;
    const needed = [...this.body(), ...ahead, ...((!this.pauseUs && this.all) || [])];
    this.#giveBack([...needed, ...needed.filter((key) => this.site.liftOf(key)).map(gateOf)], reach > 0);
    return false;
  }

  #driveTo({ mm: target_mm, across }) {
    const isNew = target_mm !== this.driveOrder.target_mm || across !== this.driveOrder.across;
    if (isNew) this.driveOrder = { sequence: (this.driveOrder.sequence % 255) + 1, target_mm, across };
    if (!isNew && this.orderUs !== undefined && !this.isDue(this.orderUs)) return;
    this.orderUs = this.now + this.site.us.drive_refresh;
    this.isDue(this.orderUs);
    this.tell("DriveOrder", { ...this.driveOrder, speed_limit_mm_s: this.site.carrier.speed_mm_s });
  }

  /** K14: what is not needed goes to whose turn it is, else to its steward, in lines of one version. */
  #giveBack(needed, isSoon = false) {
    this.needed = needed;
    const home = [...this.site.homes].find(([, node]) => node === this.node)[0];
    const held = [...this.tokens.held.keys()].filter((key) => key < 1 << 24);
    if (this.tokens.holds(home) && !held.includes(home)) held.push(home);
    const left = held.filter((key) => !needed.includes(key)).sort((a, b) => a - b);
    for (const key of this.tokens.wanted.keys()) if (key < 1 << 24 && !needed.includes(key)) this.tokens.wanted.delete(key);
    this.leftUs = left.length ? (this.leftUs ?? this.now) : undefined;
    const isUrgent = left.some((key) => this.site.fronts.has(key) || this.site.liftOf(key) || this.tokens.nextOf(key));
    if (!left.length || (isSoon && !isUrgent && left.length < 8 && !this.isDue(this.leftUs + 8 * S))) return;
    this.sayPlace();
    this.leftUs = undefined;
    const lines = new Map();
    for (const key of left) {
      const to = this.tokens.nextOf(key) || this.site.stewards.get(key >> 8);
      const line = `${to} ${(key & 0xff) === GATE ? key : key >> 8}`;
      lines.set(line, [...(lines.get(line) ?? []), key]);
    }
    for (const [line, keys] of lines) this.tokens.give(keys, parseInt(line, 10));
  }

  /** K13: whether an order of passing has come about; all or none where none has for long. */
  seesOrder(isSeen) {
    if (isSeen && !this.all) this.noOrderUs = undefined;
    else this.noOrderUs ??= this.now;
  }

  /** All to the end of the plan, but for lifts; what is a part of it goes back, and is asked for again later. */
  #wakeAll() {
    const body = this.body();
    if (this.all?.every((key) => this.tokens.holds(key)) && !this.pauseUs) [this.all, this.noOrderUs] = [undefined, undefined];
    else if (this.pauseUs && this.isDue(this.pauseUs)) this.pauseUs = 0;
    else if (!this.all && this.noOrderUs !== undefined && this.isDue(this.noOrderUs + 5 * S)) {
      this.all = [...new Set(this.windows.map(({ key }) => key))].filter((key) => !this.site.liftOf(key));
      this.tokens.wanted.clear();
    } else if (this.all?.some((key) => this.tokens.holds(key) && !body.includes(key)) && this.isDue((this.partUs ??= this.now) + 2 * S)) {
      [this.pauseUs, this.partUs] = [this.now + 5 * S, undefined];
      this.#giveBack(body);
    }
  }

  /** L3: it rides while the gate is away, and is there when that comes back with the lift's word. */
  #ride(step) {
    const [platform, lift] = [step.track << 8, this.site.lifts[step.track - 128]];
    const gate = gateOf(platform);
    const isRidden = this.ridden === step;
    if (!isRidden) this.#stand();
    this.ridden = step;
    this.tokens.want(gate);
    const before = this.track;
    this.track = lift.floors[step.to - 1];
    if (this.#mayCross(platform)) {
      this.save();
      this.sayPlace();
      return true;
    }
    this.track = before;
    if (this.tokens.holds(gate) && this.peers.get(lift.node).stop?.mark === (this.tokens.version(gate) & 0x1fff)) this.#stand();
    return false;
  }

  // --- the shuttle

  /** C1, C3, U2. */
  #handle(step) {
    const { call, place, takes } = step;
    const keys = [stationKey(place), carKey(call.car)];
    const [mark] = this.#line({ track: step.track, from: 0, to: step.to });
    if (!this.hand.isBegun && Math.abs(mark.mm - this.drive.position_mm) > 5) {
      this.#driveTo(mark);
      return false;
    }
    this.#stand();
    for (const key of keys) this.tokens.want(key);
    const isFull = [...this.cars].some(([car, one]) => one.station === place && car !== call.car);
    if (!takes && isFull && !this.hand.isBegun) return this.#leaveElsewhere(step);
    if (!keys.every((key) => this.tokens.holds(key))) return false;
    const { action, sequence } = this.shuttleOrder;
    if (action ? this.shuttle.sequence !== sequence || this.shuttle.mode !== AFTER[action] : !RESTS.includes(this.shuttle.mode)) return false;
    if (action) this.hand.actions = this.hand.actions.slice(1);
    if (this.hand.actions.length) {
      const side = place & 0x80 ? "FAR" : "NEAR";
      this.shuttleOrder = { sequence: (sequence % 255) + 1, action: this.hand.actions[0], side, wheelbase_mm: this.wheelbase(call) };
      this.hand.isBegun = true;
      if (takes) this.tasks.get(call.task).phase = "BEGUN";
      this.save();
      this.tell("ShuttleOrder", this.shuttleOrder);
      return false;
    }
    this.shuttleOrder = { sequence };
    this.#handled(step, keys);
    return true;
  }

  /** C7: another car is where this one is to be left. */
  #leaveElsewhere({ call, place }) {
    const fetches = this.robots.some((one) => one.plan?.steps.slice(one.plan.leg).some((step) => step.action === "WORK" && step.place === place));
    this.fullUs ??= this.now;
    const waitUs = !this.site.bays.has(place) ? 0 : fetches ? 10 * S : 60 * S;
    if (this.isDue(this.fullUs + waitUs) && this.isDue(this.retryUs)) {
      this.retryUs = this.now + S;
      this.tasks.get(call.task).call.to = ANY;
      if (this.remake()) [this.hand, this.fullUs] = [undefined, undefined];
    }
    return false;
  }

  wheelbase(call) {
    return this.cars.get(call.car)?.wheelbase ?? call.wheelbase;
  }

  #handled({ call, place, takes }, [station, car]) {
    const one = { station: takes ? ABOARD : place, by: this.node, version: this.tokens.version(car) & 0xffff, wheelbase: this.wheelbase(call) };
    const keeper = this.tokens.keeper(place);
    this.cars.set(call.car, one);
    this.hand = undefined;
    if (takes) this.tasks.get(call.task).phase = "LOADED";
    else {
      this.tasks.delete(call.task);
      this.done.set(call.task, place);
    }
    this.save();
    const said = this.sayCar(call.car, one);
    if (!takes) {
      this.tokens.carAt.set(car, said);
      this.tokens.give([car], keeper);
    }
    this.tokens.give([station], keeper);
    this.report(call.task, takes ? "LOADED" : "DONE", place);
  }

  // --- where it is

  get leg() {
    const n = this.legs.indexOf(this.steps[0] ?? this.legs.at(-1));
    return n > 0 && this.begun !== this.steps[0] && this.legs[n - 1].action === "STAND" ? n - 1 : Math.max(0, n);
  }

  sayPlace() {
    const { track, index } = this.place;
    const isMouth = this.track >= 192 && track < 192;
    const offset_mm = isMouth ? 0 : this.drive.position_mm - (index - 1) * this.site.pitch;
    const where = { track, index, offset_mm, speed_mm_s: this.drive.speed_mm_s };
    this.say("Progress", { itinerary_version: this.version, leg: this.version ? this.leg : 0, ...where });
    this.said = { index, isMoving: this.drive.mode !== "STANDING", us: this.now };
  }

  /** P10. */
  #tellPlace() {
    const { index, isMoving, us } = this.said;
    const stops = this.drive.mode === "STANDING" && isMoving;
    if (stops || (this.place.index !== index && (!isMoving || this.now - us >= 8 * S))) this.sayPlace();
  }

  /** P11. */
  waits(key, blocker, reason) {
    this.say("Waiting", { track: key >> 8, index: key & 0xff, blocker, reason });
  }
}

// --- lines in and out

function* lines() {
  const chunk = Buffer.alloc(65_536);
  let rest = "";
  for (;;) {
    const count = readSync(0, chunk);
    if (!count) return;
    const parts = (rest + chunk.toString("utf8", 0, count)).split("\n");
    rest = parts.pop();
    yield* parts;
  }
}

let robot;
for (const line of lines()) {
  const [local, kind, number, data] = line.split(" ", 4);
  if (kind === "start") {
    const [setup, journal] = JSON.parse(line.slice(line.indexOf("[")));
    robot = new Robot(setup, journal);
    FAULTS[setup.fault]?.(robot);
  }
  const bus = { fleet: "fleet", device: "device" }[kind];
  const frames = robot.step(Number(local), bus, Number(number), data && bus ? Buffer.from(data.slice(1), "hex") : undefined);
  const out = frames.map(([name, id, bytes]) => `${name} ${id} ${bytes.toString("hex")}`);
  if (robot.isDirty) out.unshift(`keep ${JSON.stringify(robot.journal())}`);
  robot.isDirty = false;
  const due = robot.offset === undefined ? Infinity : robot.next - robot.offset;
  writeSync(1, `${[...out, `wake ${due === Infinity ? -1 : due}`].join("\n")}\n`);
}
