// What a machine is among the others: time, presence, holds, questions and answers (chapters 2, 3, 12, 13, 14).
import { crc32 } from "node:zlib";
import { OUTSIDE, Site } from "./site.mjs";
import { Tokens, carKey } from "./tokens.mjs";
import { CONTRACT, crc16, decode, encode, joined, singles } from "./words.mjs";

const [S, MS] = [1_000_000, 1_000];
const LETTING = ["STARTING", "IDLE", "WORKING", "WAITING"];
export const newer = (a, b, bits) => a !== b && (a - b + 2 ** bits) % 2 ** bits < 2 ** (bits - 1);
const next = (n) => (n % 255) + 1;

export class Fleet {
  constructor({ node, site, digest }, journal) {
    Object.assign(this, { node, site: new Site(site, digest), frames: [], words: [], now: 0, local: 0, next: Infinity });
    this.boot = journal.boot ? next(journal.boot) : 1;
    this.isAgain = Boolean(journal.boot);
    this.epoch = journal.epoch ?? 0;
    this.person = journal.person; // H4: the reason for which a person is needed
    this.frozen = journal.frozen; // a list of rights that was read back
    this.tokens = new Tokens(this, journal);
    this.peers = new Map(this.site.nodes.filter((one) => one !== node).map((one) => [one, { node: one, heard: -Infinity, apart: 0 }]));
    this.cars = new Map(journal.cars); // origin << 16 | number: { station, by, version, wheelbase }
    this.blocked = new Set();
    this.stops = new Map();
    this.ownUntil = 0;
    this.listenUntil = 0;
    this.asks = new Map(); // node: [when, boot_before]
    this.askers = new Set();
    this.drops = new Map(); // reason: { count, told, said }
    this.digests = [];
    this.beatAt = 0;
    this.beatUs = -S;
    this.others = [...this.peers.values()];
    this.rank = this.site.nodes.indexOf(node);
  }

  // --- frames and times

  isDue(us) {
    if (us > this.now) this.next = Math.min(this.next, us);
    return us <= this.now;
  }

  /** Be woken then. */
  at(us) {
    this.isDue(us);
    return us;
  }

  say(name, signals) {
    this.words.push([name, signals]);
    if (name === "ItineraryHead" || name === "CarAt") this.beatSoon();
  }

  tell(name, signals) {
    this.frames.push(["device", ...encode("device", this.node, name, signals)]);
  }

  save() {
    this.isDirty = true;
  }

  journal() {
    const { boot, epoch, person, frozen } = this;
    const cars = [...this.cars].filter(([car, one]) => one.by === this.node || this.tokens.held.has(carKey(car)));
    return { boot, epoch, person, frozen: frozen?.isRead ? frozen : undefined, cars, ...this.tokens.journal() };
  }

  drop(reason) {
    if (!this.drops.has(reason)) this.drops.set(reason, { count: 0, told: 0, said: -Infinity });
    this.drops.get(reason).count += 1;
  }

  /** One frame (or none) at a time of the own clock; what is said, and when it wants to be woken. */
  step(local, bus, number, data) {
    const slept = this.offset !== undefined && local - this.local > 2 * this.site.us.heartbeat;
    this.local = local;
    this.now = local + (this.offset ?? 0);
    this.next = Infinity;
    if (slept) this.sleep();
    if (bus === "device") this.onDevice(decode(bus, number, data));
    else if (bus) this.#onFrame(number, data);
    if (this.offset !== undefined) this.goOn();
    for (const [name, signals] of joined(this.words)) this.frames.push(["fleet", ...encode("fleet", this.node, name, signals)]);
    const found = this.frames;
    [this.words, this.frames] = [[], []];
    return found;
  }

  #onFrame(number, data) {
    const word = data ? decode("fleet", number, data) : { fault: "UNKNOWN_IDENTIFIER" };
    const kind = word.sender > 250 ? "Gateway" : this.site.kinds.get(word.sender);
    const isStop = word.name === "EmergencyStop";
    if (word.fault) return this.drop(word.fault);
    if (word.sender === this.node) return this.#onOwn(word);
    if (!isStop && !kind) return this.drop("NOT_OF_SITE");
    if (!isStop && !word.senders.includes(kind)) return this.drop("NOT_OF_KIND");
    if (word.name === "BusTime") this.#onTime(word.bus_time_us);
    if (this.offset === undefined) return undefined;
    this.now = this.local + this.offset;
    const peer = this.peers.get(word.sender);
    if (peer && word.name !== "BusTime") this.#isHeard(peer);
    if (isStop || word.name === "Go") return this.#onStop(word);
    if (peer?.beat && word.name !== "Heartbeat" && this.isStranger(peer.beat)) return undefined;
    return singles(word).forEach((one) => this.hear(one, peer));
  }

  #onTime(told) {
    const error = told - this.local - (this.offset ?? 0);
    this.timeAt = this.local;
    if (this.offset === undefined) {
      this.offset = error;
      this.now = told;
      this.begin();
    } else if (Math.abs(error) <= 100 * MS) {
      this.far = undefined;
      this.offset += Math.max(-2 * MS, Math.min(2 * MS, error));
    } else if (this.far !== undefined && Math.abs(error - this.far) <= 20 * MS) {
      [this.offset, this.far] = [this.offset + error, undefined];
      this.now += error;
      this.sleep();
    } else this.far = error;
  }

  get hasTime() {
    return this.far === undefined && this.local - this.timeAt <= 4 * this.site.us.bus_time;
  }

  // --- presence

  /** J1, R1: a life begins, or a hold ends as one. */
  begin() {
    Object.assign(this, { started: this.now, synced: false, answered: new Set(), asked: this.now, quietUntil: this.now + 250 * MS });
    this.save();
    this.tokens.asked = new Set(this.peers.keys());
    this.beat();
    this.tokens.state();
    this.say("SyncRequest", { whom: 0, boot_before: 0 });
  }

  /** J9. */
  sleep() {
    this.listenUntil = this.now + 2 * S;
    for (const one of this.others) {
      if (one.heard > -Infinity) this.ask(one.node, 0, this.now);
      one.heard = Math.max(one.heard, this.now - 1);
    }
    this.beatAt = this.now;
  }

  isStranger({ contract, site_digest, epoch }) {
    return contract !== CONTRACT || site_digest !== this.site.digest || epoch !== this.epoch;
  }

  /** J8. */
  get isOutvoted() {
    const live = this.others.filter((one) => one.beat && this.lives(one));
    const strangers = live.filter((one) => this.isStranger(one.beat));
    const friends = live.length - strangers.length + 1;
    const lowest = Math.min(...strangers.map((one) => one.node));
    const mine = Math.min(this.node, ...live.filter((one) => !this.isStranger(one.beat)).map((one) => one.node));
    return strangers.length > friends || (strangers.length === friends && lowest < mine);
  }

  lives(peer) {
    return this.now - peer.heard <= 3 * this.site.us.heartbeat;
  }

  /** J6. */
  isObstacle(peer) {
    if (!this.lives(peer) || !peer.beat || this.isStranger(peer.beat) || !LETTING.includes(peer.beat.state) || peer.halted) return true;
    return this.site.kinds.get(peer.node) === "Robot" && (!peer.plan || this.hasLeft(peer));
  }

  get isHeld() {
    return this.stops.size > 0 || this.ownUntil > 0 || Boolean(this.person);
  }

  get isAway() {
    return this.isHeld || this.now < this.listenUntil || this.isOutvoted;
  }

  get mayTake() {
    return this.synced && !this.frozen && !this.person && !this.ownUntil;
  }

  get mayGive() {
    return this.synced && !this.frozen && !this.isHeld;
  }

  digest() {
    const plans = this.others.filter((one) => one.plan).map((one) => [one.node, one.plan.version]);
    if (this.version) plans.push([this.node, this.version]);
    const words = plans.sort((a, b) => a[0] - b[0]).map(([node, version]) => (node << 8) | version);
    for (const [car, { station }] of [...this.cars].sort((a, b) => a[0] - b[0])) if (station !== OUTSIDE) words.push(car, station);
    for (const key of [...this.blocked].sort((a, b) => a - b)) words.push((1 << 31) | key);
    return crc16(words);
  }

  beatSoon() {
    this.beatAt = Math.min(this.beatAt, Math.max(this.now + 100 * MS, this.beatUs + 300 * MS));
  }

  beat() {
    const { heartbeat } = this.site.us;
    const mine = { contract: CONTRACT, site_digest: this.site.digest, mirror_digest: this.digest() };
    this.say("Heartbeat", { ...mine, boot: this.boot, kind: "ROBOT", state: this.state, epoch: this.epoch });
    const [stopper] = this.stops.keys();
    const [reason, cause] = this.person ? [this.person, 0] : this.ownUntil ? ["DUPLICATE_NODE_ID", this.node] : ["EMERGENCY_STOP", stopper];
    const needs_person = Number(Boolean(this.person));
    if (this.isHeld) this.say("Halted", { machine: this.node, reason, cause, needs_person, boot: this.boot });
    const phase = Math.floor((this.rank * heartbeat) / this.site.nodes.length);
    this.beatUs = this.now;
    this.beatAt = this.now + heartbeat - ((((this.now - phase) % heartbeat) + heartbeat) % heartbeat);
    const lowest = this.others.every((one) => one.node > this.node || this.isObstacle(one));
    for (const one of lowest && !this.isAway ? this.others : []) {
      if (one.heard > -Infinity && !this.lives(one)) this.say("Halted", { machine: one.node, reason: one.reason ?? "NODE_SILENT", cause: 0, needs_person: 0, boot: one.boot ?? 0 });
    }
  }

  // --- holds

  #onStop({ name, sender, stopper }) {
    if (name === "EmergencyStop") this.stops.set(sender, this.now + 30 * S);
    else {
      for (const one of this.stops.keys()) if (stopper === 0 || stopper === one) this.stops.delete(one);
      if (stopper === this.node && this.person && !/JOURNAL/.test(this.person)) this.#comeBack();
      else if (!this.stops.size) this.listenUntil = this.now + 2 * S;
    }
    this.beatAt = this.now;
  }

  /** H3. */
  #onOwn({ name }) {
    const isNew = !this.ownUntil;
    if (this.offset === undefined) return;
    this.ownUntil = this.now + 3 * this.site.us.heartbeat;
    if (["TokenGrant", "TokenHeld", "CarAt", "Award"].includes(name)) this.holdFor("DUPLICATE_NODE_ID");
    if (isNew) this.beatAt = this.now;
  }

  holdFor(reason) {
    if (this.person !== reason) this.beatAt = this.now;
    this.person = reason;
    this.save();
  }

  #comeBack() {
    Object.assign(this, { ownUntil: 0, person: undefined, boot: next(this.boot), isAgain: true, version: 0, listenUntil: this.now + 2 * S });
    this.begin();
  }

  /** R7. */
  isComparing(node) {
    return !this.synced && !this.answered.has(node);
  }

  isOutdated() {
    this.holdFor(this.isAgain ? "JOURNAL_SHORT" : "JOURNAL_LOST");
  }

  #wakeHolds() {
    for (const [sender, us] of this.stops) {
      if (!this.isDue(us)) continue;
      this.stops.delete(sender);
      if (!this.stops.size) this.listenUntil = this.now + 2 * S;
    }
    if (this.ownUntil && !this.person && this.isDue(this.ownUntil)) this.#comeBack();
    if (this.frozen && !this.frozen.isRead && this.isDue(this.frozen.said + 10 * S)) this.frozen = undefined;
    if (this.listenUntil && this.isDue(this.listenUntil)) [this.listenUntil, this.beatAt] = [0, this.now];
    if (this.wasAway !== this.isAway) [this.wasAway, this.beatAt] = [this.isAway, this.now];
  }

  // --- questions and answers

  ask(node, before, at) {
    const known = this.asks.get(node);
    if (!known || known[0] > at) this.asks.set(node, [at, before]);
  }

  #isHeard(peer) {
    if (peer.heard === -Infinity) this.ask(peer.node, 0, this.now + 400 * MS + 5 * MS * this.rank);
    peer.heard = this.now;
  }

  onHeartbeat(word, peer) {
    const again = peer.boot !== undefined && (peer.boot !== word.boot || (word.state === "STARTING" && peer.beat.state !== "STARTING"));
    if (again) {
      Object.assign(peer, { plan: undefined, open: undefined, isStarted: true });
      this.tokens.startsAnew(peer.node);
      this.ask(peer.node, peer.boot, this.now);
    }
    if (word.state !== "OBSTACLE" && word.state !== "STOPPED") peer.halted = false;
    Object.assign(peer, { beat: word, boot: word.boot });
    if (word.state !== "STARTING") peer.known = word.boot;
    if (this.isStranger(word)) return;
    const isSame = [this.digest(), ...this.digests.map(([, one]) => one)].includes(word.mirror_digest);
    peer.apart = isSame || !this.version ? 0 : peer.apart + 1;
    if (peer.apart && (peer.apart <= 3 || peer.apart % 8 === 0)) this.ask(peer.node, 0, this.now + 20 * MS + 5 * MS * this.rank);
  }

  onSync({ name, sender, whom, boot_before }, peer) {
    if (name === "SyncDone") {
      this.asks.delete(sender);
      if (whom !== 0 && whom !== this.node) return;
      this.answered.add(sender);
      this.tokens.asked.delete(sender);
    } else if (whom === 0 || whom === this.node) {
      if (boot_before > this.boot && !this.isAgain && this.now < this.started + 8 * S) this.isOutdated();
      this.askers.add(sender);
      if (whom === 0 && peer?.known && !(this.now < peer.asked + 250 * MS)) this.ask(sender, peer.known, this.now);
    }
  }

  #wakeSync() {
    for (const [node, [at, boot_before]] of this.asks) {
      const peer = this.peers.get(node);
      if (!this.isDue(at)) continue;
      this.asks.delete(node);
      if (peer.apart && !boot_before && peer.beat?.mirror_digest === this.digest()) continue;
      this.tokens.asked.add(node);
      peer.asked = this.now;
      this.say("SyncRequest", { whom: node, boot_before });
    }
    if (this.synced) return;
    const missing = this.others.filter((one) => !this.answered.has(one.node) && !one.halted && (this.lives(one) || this.now < this.started + 6 * S));
    if (!missing.length && this.isDue(this.started + this.site.us.heartbeat)) this.synced = true;
    else if (this.isDue(Math.max(this.started + this.site.us.heartbeat, this.asked + 500 * MS))) {
      this.asked = this.now;
      this.isDue(this.now + 500 * MS);
      for (const one of missing) this.say("SyncRequest", { whom: one.node, boot_before: 0 });
    }
  }

  /** R3, R4. */
  #answer() {
    if (!this.askers.size || !this.isDue(this.quietUntil)) return;
    this.stateAll();
    for (const node of this.askers) if (this.peers.get(node)?.isStarted) this.tokens.remind(node);
    this.tokens.seenOf((holder) => this.peers.has(holder) && !this.lives(this.peers.get(holder)));
    this.say("SyncDone", { whom: this.askers.size === 1 ? [...this.askers][0] : 0, boot: this.boot });
    this.askers.clear();
    this.quietUntil = this.now + 250 * MS;
  }

  // --- rights made anew

  onRegeneration({ regeneration_phase: phase, epoch, lost, absent, tokens, digest }) {
    const answer = (state, reason = "NONE", of = this.frozen?.list ?? []) => {
      const rows = of.map(([key, version, holder]) => [key >> 24, key & 0xffffff, version, holder]).sort((a, b) => a[0] - b[0] || a[1] - b[1]);
      const bytes = Buffer.alloc(16 * rows.length);
      rows.flat().forEach((one, n) => bytes.writeUInt32BE(one, 4 * n));
      const sum = rows.length ? crc32(bytes) & 0xffff : 0;
      this.say("RegenerationState", { regeneration_phase: state, epoch, tokens: rows.length, digest: sum, reason });
      return rows.length === tokens && sum === digest;
    };
    if (phase === "FREEZE") {
      if (epoch !== next(this.epoch)) return answer("REFUSED", "OTHER_EPOCH", []);
      const isHelpless = /JOURNAL/.test(this.person);
      if (absent === this.node || (lost === this.node && !isHelpless)) return answer("REFUSED", "NOT_AUTHORISED", []);
      if (!this.frozen) this.frozen = { epoch, lost, list: [], told: -Infinity };
      this.frozen.said = this.now;
      answer("FREEZE", "NONE", []);
      if (this.now >= this.frozen.told + 4 * S) {
        this.frozen.told = this.now;
        this.tokens.state();
        for (const [car, one] of this.cars) if (one.by === lost && one.station !== OUTSIDE) this.sayCar(car, one);
        this.tokens.seenOf(() => true);
      }
    } else if (this.frozen?.epoch === epoch && phase === "READ_BACK") {
      this.frozen.said = this.now;
      this.frozen.isRead = answer("READ_BACK");
      this.save();
    } else if (this.frozen?.epoch === epoch && phase === "COMMIT" && this.frozen.isRead) {
      const { list } = this.frozen;
      Object.assign(this, { epoch, frozen: undefined, beatAt: this.now, person: undefined });
      this.tokens.assign(list);
      answer("COMMIT", "NONE", list);
    } else if (phase === "COMMIT" && epoch === this.epoch) answer("COMMIT", "NONE", []);
    else if (phase === "ABORT") this.frozen = undefined;
    return undefined;
  }

  // --- all that is due

  wakeFleet() {
    this.#wakeHolds();
    this.#wakeSync();
    this.tokens.wake();
    for (const [reason, one] of this.drops) {
      if (one.count === one.told || !this.isDue(one.said + this.site.us.heartbeat)) continue;
      Object.assign(one, { told: one.count, said: this.now });
      this.say("Diagnostic", { reason, count: one.count });
    }
    this.#answer();
    if (this.isDue(this.beatAt)) this.beat();
    this.isDue(this.beatAt);
    const digest = this.digest();
    if (digest !== this.lastDigest) this.digests.push([this.now + 300 * MS, this.lastDigest]);
    this.digests = this.digests.filter(([us]) => us > this.now);
    this.lastDigest = digest;
  }
}
