// What a machine is among the others: time, presence, holds, questions and answers (chapters 2, 3, 12, 13, 14).
import { crc32 } from "node:zlib";
import { OUTSIDE, Site } from "./site.mjs";
import { Tokens, carKey, keyOf } from "./tokens.mjs";
import { CONTRACT, crc16, decode, encode, joined, singles } from "./words.mjs";

export const [S, MS] = [1_000_000, 1_000];
const LETTING = ["STARTING", "IDLE", "WORKING", "WAITING"];
const RIGHTS = ["TokenGrant", "TokenHeld", "CarAt", "Award"];
const WAITING = ["Waiting", "TaskReport", "TokenRequest", "ItineraryHead"];
export const newer = (a, b, bits) => a !== b && (a - b + 2 ** bits) % 2 ** bits < 2 ** (bits - 1);
export const next = (n) => (n % 255) + 1;

export class Fleet {
  constructor({ node, site, digest }, kept) {
    Object.assign(this, { node, site: new Site(site, digest), epoch: 0, ...kept });
    Object.assign(this, { frames: [], words: [], digests: [], blocked: new Set(), askers: new Set() });
    Object.assign(this, { now: 0, local: 0, next: Infinity, beatUs: -S, beatAt: 0, ownUntil: 0, listenUntil: 0 });
    this.stops = new Map(); // who stopped me: until when
    [this.drops, this.told] = [new Map(), new Map()]; // reason: how often, now and when it was told
    this.marks = new Map(); // what is done at most so often: when it may be again
    this.cars = new Map(kept.cars); // origin << 16 | number: { station, by, version, wheelbase }
    this.boot = next(kept.boot ?? 0);
    this.isAgain = Boolean(kept.boot);
    this.rank = this.site.nodes.indexOf(node);
    this.others = this.site.nodes.filter((one) => one !== node).map((one) => ({ node: one, heard: -Infinity }));
    this.peers = new Map(this.others.map((one) => [one.node, one]));
    this.tokens = new Tokens(this, kept.tokens);
  }

  /** R1: what is kept before it is said. */
  journal() {
    const { boot, epoch, person, frozen } = this;
    const cars = [...this.cars].filter(([car, one]) => one.by === this.node || this.tokens.holds(carKey(car)));
    return { boot, epoch, person, frozen: frozen?.isRead ? frozen : undefined, cars, tokens: this.tokens.journal() };
  }

  // --- frames and times

  save = () => (this.isDirty = true);
  tell = (name, signals) => this.frames.push(["device", ...encode("device", this.node, name, signals)]);
  drop = (reason) => this.drops.set(reason, (this.drops.get(reason) ?? 0) + 1);

  /** Whether it is time; else it is woken then. */
  isDue(us) {
    if (us > this.now) this.next = Math.min(this.next, us);
    return us <= this.now;
  }

  /** Whether it was not done for so long; then it is done now. */
  every(what, us) {
    if (!this.isDue(this.marks.get(what) ?? -Infinity)) return false;
    this.marks.set(what, this.now + us);
    return this.isDue(this.now + us) || true;
  }

  say(name, signals) {
    this.words.push([name, signals]);
    if (name === "ItineraryHead" || name === "CarAt") this.beatSoon();
  }

  /** One frame (or none) at a time of the own clock: what is said, and by `next` when it wants to be woken. */
  step(local, bus, number, data) {
    const slept = this.offset !== undefined && local - this.local > 2 * this.site.us.heartbeat;
    Object.assign(this, { local, now: local + (this.offset ?? 0), next: Infinity });
    if (slept) this.sleep();
    if (bus === "device") this.onDevice(decode(bus, number, data));
    else if (bus) this.#onFrame(number, data);
    if (this.offset !== undefined) this.goOn();
    const words = joined(this.words).map(([name, signals]) => ["fleet", ...encode("fleet", this.node, name, signals)]);
    const found = [...words, ...this.frames];
    [this.words, this.frames] = [[], []];
    return found;
  }

  /** F2, F3. */
  #onFrame(number, data) {
    const word = data ? decode("fleet", number, data) : { fault: "UNKNOWN_IDENTIFIER" };
    const kind = word.sender > 250 ? "Gateway" : this.site.kinds.get(word.sender);
    const peer = this.peers.get(word.sender);
    const isStop = word.name === "EmergencyStop";
    if (word.fault) return this.drop(word.fault);
    if (word.sender === this.node) return this.#onOwn(word);
    if (!isStop && !word.senders.includes(kind)) return this.drop(kind ? "NOT_OF_KIND" : "NOT_OF_SITE");
    if (word.name === "BusTime") return this.#onTime(word.bus_time_us);
    if (this.offset === undefined) return undefined;
    if (peer) this.#isHeard(peer);
    if (isStop || word.name === "Go") return this.#onStop(word);
    if (peer?.beat && word.name !== "Heartbeat" && this.isStranger(peer.beat)) return undefined;
    return singles(word).forEach((one) => this.hear(one, peer));
  }

  /** A word's name is that of its method, but for the frames of a set, and tokens. */
  hear(word, peer) {
    const { name } = word;
    if (name === "TokenAssigned") this.#onAssigned(word);
    else if (!name.startsWith("Token")) this[`on${/^(Call|Itinerary)/.exec(name)?.[0] ?? name}`]?.(word, peer);
    else if (peer && !this.ownUntil) this.tokens.hear(word);
    if (peer && WAITING.includes(name)) peer.waitsUs = this.now;
  }

  /** T2, T3. */
  #onTime(told) {
    const [error, since] = [told - this.local - (this.offset ?? 0), told - this.toldUs];
    this.toldUs = told;
    if (error < -100 * MS && since >= 0 && since <= 100 * MS) return (this.far = undefined);
    const isSame = Math.abs(error - this.far) <= 20 * MS;
    const [isFirst, isNear] = [this.offset === undefined, Math.abs(error) <= 100 * MS];
    this.timeAt = this.local;
    this.far = isFirst || isNear || isSame ? undefined : error;
    if (this.far !== undefined) return;
    const step = isNear && !isFirst ? Math.max(-2 * MS, Math.min(2 * MS, error)) : error;
    this.offset = (this.offset ?? 0) + step;
    this.now = this.local + this.offset;
    if (isFirst) this.begin();
    else if (!isNear) this.sleep();
  }

  /** T5. */
  hasTime = () => this.far === undefined && this.local - this.timeAt <= 4 * this.site.us.bus_time;

  // --- presence

  /** J1, R1: a life begins, or a hold ends as one. */
  begin() {
    Object.assign(this, { started: this.now, synced: false, quietUntil: this.now + 250 * MS });
    for (const one of this.others) Object.assign(one, { hasAnswered: false, isAsked: true });
    this.every("ask who is missing", 500 * MS);
    this.save();
    this.beat();
    this.tokens.state();
    this.say("SyncRequest", { whom: 0, boot_before: 0 });
  }

  /** J9. */
  sleep() {
    this.listen();
    for (const one of this.others.filter(({ heard }) => heard > -Infinity)) {
      this.ask(one, 0, this.now);
      Object.assign(one, { heard: this.now - 1, wasSilent: true });
    }
  }

  listen() {
    this.listenUntil = this.now + 2 * S;
    this.beatAt = this.now;
  }

  lives = (peer) => this.now - peer.heard <= 3 * this.site.us.heartbeat;
  isRobot = ({ node }) => this.site.kinds.get(node) === "Robot";
  isStranger = ({ contract, site_digest, epoch }) =>
    contract !== CONTRACT || site_digest !== this.site.digest || epoch !== this.epoch;

  /** J8: of two halves that with the lowest node-ID counts. */
  isOutvoted() {
    const live = this.others.filter((one) => one.beat && this.lives(one));
    const strangers = live.filter((one) => this.isStranger(one.beat));
    const lowest = Math.min(this.node, ...live.map((one) => one.node));
    const excess = 2 * strangers.length - live.length - 1;
    return excess > 0 || (excess === 0 && strangers.some((one) => one.node === lowest));
  }

  /** J6. */
  isObstacle(peer) {
    if (!this.lives(peer) || !peer.beat || this.isStranger(peer.beat) || peer.halted) return true;
    return !LETTING.includes(peer.beat.state) || (this.isRobot(peer) && (!peer.plan || this.hasLeft(peer)));
  }

  /** Reason and cause of a hold (H1, H3, H4), and whether a person is needed. */
  get hold() {
    const [stopper] = this.stops.keys();
    if (this.person) return [this.person, 0, 1];
    if (this.ownUntil) return ["DUPLICATE_NODE_ID", this.node, 0];
    return stopper !== undefined ? ["EMERGENCY_STOP", stopper, 0] : undefined;
  }

  isAway = () => Boolean(this.hold) || this.now < this.listenUntil || this.isOutvoted();
  mayTake = () => this.synced && !this.frozen && !this.person && !this.ownUntil;
  mayGive = () => this.synced && !this.frozen && !this.hold;

  /** J4. */
  digest() {
    const plans = [...this.others, this].filter((one) => one.plan).sort((a, b) => a.node - b.node);
    const cars = [...this.cars].filter(([, one]) => one.station !== OUTSIDE).sort((a, b) => a[0] - b[0]);
    const blocked = [...this.blocked].sort((a, b) => a - b).map((key) => (1 << 31) | key);
    const words = plans.map(({ node, plan }) => (node << 8) | plan.version);
    return crc16([...words, ...cars.flatMap(([car, { station }]) => [car, station]), ...blocked]);
  }

  /** J2: after a word that changes digests. */
  beatSoon = () => (this.beatAt = Math.min(this.beatAt, Math.max(this.now + 100 * MS, this.beatUs + 300 * MS)));

  beat() {
    const { heartbeat } = this.site.us;
    const mine = { contract: CONTRACT, site_digest: this.site.digest, mirror_digest: this.digest() };
    this.say("Heartbeat", { ...mine, boot: this.boot, kind: "ROBOT", state: this.state, epoch: this.epoch });
    const phase = Math.floor((this.rank * heartbeat) / this.site.nodes.length);
    this.beatUs = this.now;
    this.beatAt = (Math.floor((this.now - phase) / heartbeat) + 1) * heartbeat + phase;
    const [awaited] = this.isNew() ? this.missing() : [];
    const [reason, cause, needs_person] = this.hold ?? (awaited ? ["JOURNAL_LOST", awaited.node, 0] : []);
    if (reason) this.say("Halted", { machine: this.node, reason, cause, needs_person, boot: this.boot });
    const isLowest = !this.isAway() && this.others.every((one) => one.node > this.node || this.isObstacle(one));
    for (const one of this.others.filter((other) => isLowest && other.heard > -Infinity && !this.lives(other))) {
      this.say("Halted", { machine: one.node, reason: one.reason ?? "NODE_SILENT", boot: one.boot });
    }
  }

  onHalted({ machine, sender, reason }, peer) {
    if (machine === sender) Object.assign(peer, { halted: true, reason });
  }

  // --- holds

  #onStop({ name, sender, stopper }) {
    this.beatAt = this.now;
    if (name === "EmergencyStop") return this.stops.set(sender, this.now + 30 * S);
    for (const one of this.stops.keys()) if (stopper === 0 || stopper === one) this.stops.delete(one);
    if (stopper === this.node && this.person && !/JOURNAL/.test(this.person)) return this.#comeBack();
    return this.stops.size || this.listen();
  }

  /** H3. */
  #onOwn({ name }) {
    if (this.offset === undefined) return;
    if (!this.ownUntil) this.beatAt = this.now;
    this.ownUntil = this.now + 3 * this.site.us.heartbeat;
    if (RIGHTS.includes(name)) this.holdFor("DUPLICATE_NODE_ID");
  }

  /** H4. */
  holdFor(reason) {
    if (this.person !== reason) this.beatAt = this.now;
    this.person = reason;
    this.save();
  }

  #comeBack() {
    Object.assign(this, { ownUntil: 0, person: undefined, boot: next(this.boot), isAgain: true, plan: undefined });
    this.listen();
    this.begin();
  }

  #wakeHolds() {
    for (const [sender, us] of this.stops) {
      if (this.isDue(us) && this.stops.delete(sender) && !this.stops.size) this.listen();
    }
    if (this.ownUntil && !this.person && this.isDue(this.ownUntil)) this.#comeBack();
    if (this.frozen && !this.frozen.isRead && this.isDue(this.frozen.said + 10 * S)) this.frozen = undefined;
    this.isDue(this.listenUntil);
    if (this.wasAway !== this.isAway()) [this.wasAway, this.beatAt] = [this.isAway(), this.now];
  }

  // --- questions and answers

  /** A question to a peer is put off until then, the soonest counts. */
  ask(peer, before, at) {
    if (!(peer.question?.at <= at)) peer.question = { at, before };
  }

  #isHeard(peer) {
    if (peer.heard === -Infinity) this.ask(peer, 0, this.now + 400 * MS + 5 * MS * this.rank);
    // P1: it made plans that nobody heard.
    else if (!this.lives(peer)) {
      this.#couldNotGo(peer, peer.heard);
      peer.wasSilent = true;
    }
    peer.heard = this.now;
  }

  /** J6: since then it was an obstacle, and has not stood. */
  #couldNotGo(peer, since) {
    Object.assign(peer, { movedUs: peer.movedUs + this.now - since, waitsUs: this.now });
  }

  onHeartbeat(word, peer) {
    const { boot, state, mirror_digest } = word;
    const isOther = peer.boot !== boot || (state === "STARTING" && peer.beat.state !== state);
    const isAnew = peer.boot !== undefined && isOther;
    if (isAnew) this.ask(peer, peer.boot, this.now);
    if (isAnew) Object.assign(peer, { plan: undefined, isStarted: true });
    if (peer.halted || (peer.beat && !LETTING.includes(peer.beat.state))) this.#couldNotGo(peer, peer.beatUs);
    if (state !== "OBSTACLE" && state !== "STOPPED") peer.halted = false;
    Object.assign(peer, { beat: word, beatUs: this.now, boot, known: state === "STARTING" ? peer.known : boot });
    if (this.isStranger(word)) return;
    const isSame = [this.digest(), ...this.digests.map(([, one]) => one)].includes(mirror_digest);
    peer.apart = isSame || !this.plan ? 0 : peer.apart + 1;
    const isTurn = peer.apart && (peer.apart <= 3 || peer.apart % 8 === 0);
    if (isTurn) this.ask(peer, 0, this.now + 20 * MS + 5 * MS * this.rank);
  }

  onSyncDone({ whom, askers }, peer) {
    const isForAll = whom === 0 && (askers === 0 || Math.floor(askers / 2 ** (this.rank % 48)) % 2 === 1);
    peer.question = undefined;
    if (isForAll || whom === this.node) Object.assign(peer, { hasAnswered: true, isAsked: false });
    // C2: a car that it has not named in three answers has left.
    if (this.isObstacle(peer) || peer.beat.state === "STARTING") return;
    for (const [car, one] of this.cars) {
      if (one.by === peer.node && one.station !== OUTSIDE && ++one.lacks >= 3) this.cars.delete(car);
    }
  }

  onSyncRequest({ sender, whom, boot_before }, peer) {
    if (whom !== 0 && whom !== this.node) return;
    const isForgotten = boot_before && newer(boot_before, this.boot, 8) && this.now < this.started + 8 * S;
    if (isForgotten) this.holdFor("JOURNAL_LOST");
    this.askers.add(sender);
    if (whom === 0 && peer?.known && !(this.now < peer.askedUs + 250 * MS)) this.ask(peer, peer.known, this.now);
  }

  /** R7: somebody who has not answered yet knows more of my rights than my journal. */
  isComparing = (node) => !this.synced && !this.peers.get(node).hasAnswered;
  isOutdated = () => this.holdFor(this.isAgain ? "JOURNAL_SHORT" : "JOURNAL_LOST");
  /** R8: a first life in a fleet that has a past waits for all, else (R2) for whoever lives. */
  isNew = () => !this.synced && !this.isAgain && this.others.some((one) => one.boot > 1);
  mayLive = (one) => !one.halted && (this.lives(one) || this.now < this.started + 6 * S);
  missing = () => this.others.filter((one) => !one.hasAnswered && (this.isNew() || this.mayLive(one)));

  #wakeSync() {
    for (const one of this.others.filter(({ question }) => question && this.isDue(question.at))) {
      const { before } = one.question;
      one.question = undefined;
      if (one.apart && !before && one.beat?.mirror_digest === this.digest()) continue;
      Object.assign(one, { isAsked: true, askedUs: this.now });
      this.say("SyncRequest", { whom: one.node, boot_before: before });
    }
    if (this.synced || !this.isDue(this.started + this.site.us.heartbeat)) return;
    this.synced = !this.missing().length;
    if (this.synced || !this.every("ask who is missing", 500 * MS)) return;
    for (const one of this.missing()) this.say("SyncRequest", { whom: one.node, boot_before: 0 });
  }

  /** R3, R4. */
  #answer() {
    if (!this.askers.size || !this.isDue(this.quietUntil)) return;
    this.stateAll();
    const isAnew = (peer, { life }) => peer?.isStarted && this.askers.has(peer.node) && life !== peer.boot;
    const isSilent = (peer) => peer && !this.lives(peer);
    this.tokens.tellSeen((one) => isAnew(this.peers.get(one.by), one) || isSilent(this.peers.get(one.holder)));
    this.say("SyncDone", { whom: this.askers.size === 1 ? [...this.askers][0] : 0, boot: this.boot });
    this.askers.clear();
    this.quietUntil = this.now + 250 * MS;
  }

  // --- rights made anew

  #onAssigned(word) {
    const isNew = this.frozen && !this.frozen.list.some(([key]) => key === keyOf(word));
    if (isNew) this.frozen.list.push([keyOf(word), word.version, word.holder]);
  }

  onRegeneration({ regeneration_phase: phase, epoch, lost, absent, tokens, digest }) {
    const frozen = this.frozen?.epoch === epoch && phase !== "FREEZE" ? this.frozen : undefined;
    const list = (frozen?.list ?? []).toSorted((a, b) => a[0] - b[0]);
    const rows = list.flatMap(([key, ...row]) => [key >> 24, key & 0xffffff, ...row]);
    const sum = crc32(Buffer.from(Uint32Array.from(rows).buffer).swap32()) & 0xffff;
    const isMine = absent === this.node || (lost === this.node && !/JOURNAL/.test(this.person));
    const answer = (state, reason = "NONE") => {
      this.say("RegenerationState", { regeneration_phase: state, epoch, tokens: list.length, digest: sum, reason });
    };
    if (phase === "ABORT") this.frozen = undefined;
    else if (phase === "FREEZE" && epoch !== next(this.epoch)) answer("REFUSED", "OTHER_EPOCH");
    else if (phase === "FREEZE" && isMine) answer("REFUSED", "NOT_AUTHORISED");
    else if (phase === "FREEZE") {
      answer("FREEZE");
      this.frozen = { epoch, list: [], ...this.frozen, said: this.now };
      if (this.every("say all that is frozen", 4 * S)) this.#sayAllOf(lost);
    } else if (phase === "READ_BACK" && frozen) {
      answer("READ_BACK");
      Object.assign(frozen, { said: this.now, isRead: list.length === tokens && sum === digest });
      this.save();
    } else if (phase === "COMMIT" && (frozen?.isRead || epoch === this.epoch)) {
      answer("COMMIT");
      this.tokens.assign(list);
      if (frozen) Object.assign(this, { epoch, frozen: undefined, beatAt: this.now, person: undefined });
    }
  }

  /** G2. */
  #sayAllOf(lost) {
    this.tokens.state();
    for (const [car, one] of this.cars) if (one.by === lost && one.station !== OUTSIDE) this.sayCar(car, one);
    this.tokens.tellSeen(() => true);
  }

  // --- all that is due

  wakeFleet() {
    this.#wakeHolds();
    this.#wakeSync();
    for (const [reason, count] of this.drops) {
      const isTold = this.told.get(reason) === count || !this.every(reason, this.site.us.heartbeat);
      if (!isTold) this.say("Diagnostic", { reason, count });
      if (!isTold) this.told.set(reason, count);
    }
    this.#answer();
    if (this.isDue(this.beatAt)) this.beat();
    this.isDue(this.beatAt);
    this.digests = this.digests.filter(([us]) => us > this.now);
    if (this.digest() !== this.lastDigest) this.digests.push([this.now + 300 * MS, this.lastDigest]);
    this.lastDigest = this.digest();
  }
}
