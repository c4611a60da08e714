// The tokens of one machine (chapter 8), kept and told as a journal has them. A key is kind << 24 | number.
const KINDS = ["SEGMENT", "STATION", "CAR", "TASK"];
export const stationKey = (place) => (1 << 24) | place;
export const carKey = (car) => (2 << 24) | car;
const of = (key) => ({ token_kind: KINDS[key >> 24], token: key & 0xffffff });
const isSegment = (key) => key >> 24 === 0;
const LOW = 0xfffff;

export class Tokens {
  constructor(robot, journal) {
    this.robot = robot;
    this.held = new Map(journal.held);
    this.seen = new Map(journal.seen); // the newest version that I did anything with
    this.given = new Map(journal.given); // key: [version, new holder], the last give of each
    this.leaving = new Map(); // key: { version, to, times, due }
    for (const [key, version, to] of journal.leaving ?? []) this.leaving.set(key, { version, to, times: 0, due: 0 });
    this.believed = new Map(journal.believed); // key: [version, holder]
    this.wanted = new Map(); // key: { times, due, since, isTold }
    this.disputed = new Map(); // key: the grant that waits for a chain
    this.unproved = new Map(); // key: [giver, version, holder], given away by word and not confirmed
    this.stated = new Map(); // node: key: version, what it said itself that it holds
    this.before = new Map(); // the same, in its life before
    this.asked = new Set(); // whom I asked for all
    this.carAt = new Map(); // C3: what goes before each repeat of a car's grant
    this.requests = new Map(); // key: node: { us, plan, predecessor }
    this.paceUs = 0;
  }

  journal() {
    const leaving = [...this.leaving].map(([key, one]) => [key, one.version, one.to]);
    return { held: [...this.held], seen: [...this.seen], given: [...this.given], believed: [...this.believed], leaving };
  }

  /** K1. */
  firstHolder(key) {
    const { site } = this.robot;
    if (key >> 24 >= 2) return (key >> 16) & 0xff;
    if (key >> 24 === 1 && site.bays.has(key & 0xffff)) return site.bays.get(key & 0xffff);
    return (isSegment(key) && site.homes.get(key)) || site.stewards.get((key >> 8) & 0xff);
  }

  /** C1: who keeps a station, and so the car in it. */
  keeper(place) {
    return this.robot.site.bays.get(place) ?? this.robot.site.stewards.get(place >> 8);
  }

  holds(key) {
    return this.held.has(key) || (!this.seen.has(key) && this.firstHolder(key) === this.robot.node);
  }

  version(key) {
    return this.held.get(key) ?? this.seen.get(key) ?? 0;
  }

  belief(key) {
    return this.believed.get(key) ?? [0, this.firstHolder(key)];
  }

  /** K9. */
  want(key) {
    if (!this.holds(key) && !this.wanted.has(key)) this.wanted.set(key, { times: 0, due: 0, since: this.robot.now });
  }

  wake() {
    const { robot } = this;
    const pause = (times) => (times <= 3 ? robot.site.us.token_repeat : Math.min(25 * robot.site.us.token_repeat, robot.site.us.token_repeat << Math.min(times - 3, 10)));
    for (const [key, one] of this.wanted) {
      if (!robot.isDue(one.due) || (one.times > 3 && !robot.isDue(this.paceUs))) continue;
      Object.assign(one, { times: one.times + 1, due: robot.at(robot.now + pause(one.times + 1)) });
      if (one.times > 3) this.paceUs = robot.now + 100_000;
      const claim = isSegment(key) ? robot.claim(key) : { itinerary_version: robot.version, predecessor: 0 };
      robot.say("TokenRequest", { ...of(key), version_seen: Math.max(this.version(key), this.belief(key)[0]) & LOW, ...claim });
    }
    for (const [key, one] of robot.synced ? this.leaving : []) {
      if (!robot.isDue(one.due)) continue;
      Object.assign(one, { times: one.times + 1, due: robot.at(robot.now + pause(one.times + 1)) });
      this.#grant(key, one);
    }
  }

  #grant(key, one) {
    one.said = this.robot.now;
    if (this.carAt.has(key)) this.robot.say("CarAt", this.carAt.get(key));
    this.robot.say("TokenGrant", { ...of(key), version: one.version, holder: one.to });
  }

  /** K3, K4: several at once, so that what goes together has one version. */
  give(keys, to) {
    const version = Math.max(...keys.map((key) => Math.max(this.version(key), ...this.#inLine(key)))) + 1;
    for (const key of keys) {
      const due = this.robot.now + this.robot.site.us.token_repeat;
      this.held.delete(key);
      this.seen.set(key, version);
      this.given.set(key, [version, to]);
      this.believed.set(key, [version, to]);
      this.leaving.set(key, { version, to, times: 1, due, said: this.robot.now });
      this.requests.get(key)?.delete(to);
    }
    for (const key of keys) this.robot.say("TokenGrant", { ...of(key), version, holder: to });
    this.robot.save();
  }

  #inLine(key) {
    const found = [];
    for (const step of isSegment(key) ? [1, -1] : []) {
      for (let one = key + step; this.held.has(one) && one >> 8 === key >> 8 && Math.abs(one - key) < 16; one += step) found.push(this.held.get(one));
    }
    return found;
  }

  #hold(key, version) {
    if (isSegment(key)) this.robot.seesOrder(true);
    this.held.set(key, version);
    this.seen.set(key, version);
    this.believed.set(key, [version, this.robot.node]);
    for (const table of [this.leaving, this.wanted, this.disputed]) table.delete(key);
    this.robot.save();
  }

  // --- what is heard

  hear(word) {
    const key = (KINDS.indexOf(word.token_kind) << 24) | word.token;
    const { robot } = this;
    const { sender, version } = word;
    if (this.robot.isComparing(sender) && this.holds(key) && /Held|Given|Seen/.test(word.name) && version > this.version(key)) this.robot.isOutdated();
    if (word.name === "TokenGrant" && word.holder === robot.node) this.#offered(key, word);
    else if (word.name === "TokenGrant" || word.name === "TokenGiven") this.#passed(key, sender, version, word.holder);
    else if (word.name === "TokenHeld") this.#stated(key, sender, version);
    else if (word.name === "TokenDispute" && word.believed === robot.node) this.#answer(key);
    else if (word.name === "TokenRequest") this.#requested(key, word);
    else if (word.name === "TokenRefusal" && word.requester === robot.node && this.wanted.has(key)) this.#refused(key, word);
  }

  #offered(key, { sender, version, ...word }) {
    const { robot } = this;
    if (!robot.mayTake) return;
    const [known, holder] = this.belief(key);
    if (version <= this.version(key) || this.holds(key)) this.#answer(key);
    else if (sender === holder && version > known) {
      this.#hold(key, version);
      robot.say("TokenHeld", { ...of(key), version });
    } else if (sender !== holder) {
      this.disputed.set(key, { sender, version, ...word });
      robot.say("TokenDispute", { ...of(key), version, believed: holder });
    }
  }

  #passed(key, giver, version, to) {
    this.stated.get(giver)?.delete(key);
    if (this.holds(key)) {
      if (giver !== this.robot.node) this.#claimed(key);
    } else if (to !== this.robot.node && giver === this.belief(key)[1] && version > this.belief(key)[0]) {
      this.unproved.set(key, [giver, version, to]);
      this.#verified(key, version, to);
    }
  }

  #stated(key, holder, version) {
    if (this.holds(key)) return this.#claimed(key);
    const [known, believed] = this.belief(key);
    if (version < known) return this.robot.say("TokenSeen", { ...of(key), version: known, holder: believed });
    if (holder !== believed && !this.asked.has(holder)) return undefined;
    if (!this.stated.has(holder)) this.stated.set(holder, new Map());
    this.stated.get(holder).set(key, version);
    this.unproved.delete(key);
    return this.#verified(key, version, holder);
  }

  #claimed(key) {
    this.robot.drop("RIGHT_CLAIMED");
    this.#answer(key);
  }

  #verified(key, version, holder) {
    this.believed.set(key, [version, holder]);
    if (this.leaving.get(key)?.version <= version) {
      this.leaving.delete(key);
      this.carAt.delete(key);
      this.robot.save();
    }
    const waiting = this.disputed.get(key);
    this.disputed.delete(key);
    if (waiting) this.#offered(key, waiting);
  }

  #answer(key) {
    if (this.holds(key)) this.robot.say("TokenHeld", { ...of(key), version: this.version(key) });
    else if (this.given.has(key)) this.robot.say("TokenGiven", { ...of(key), version: this.given.get(key)[0], holder: this.given.get(key)[1] });
  }

  /** K10, K11: every request is remembered, whoever holds the token. */
  #requested(key, { sender, itinerary_version: plan, predecessor }) {
    const leaving = this.leaving.get(key);
    if (leaving?.to === sender && this.robot.now > leaving.said + 20_000) this.#grant(key, leaving);
    if (!this.requests.has(key)) this.requests.set(key, new Map());
    this.requests.get(key).set(sender, { us: this.robot.now, plan, predecessor });
    if (!this.holds(key) || !this.robot.mayGive) return;
    const reason = this.robot.objection(key, sender, this.requests.get(key).get(sender));
    if (!reason) this.give([key], sender);
    else this.robot.say("TokenRefusal", { ...of(key), version: this.version(key) & LOW, requester: sender, reason });
  }

  /** Whose turn it is by its request, the oldest first; 0 for nobody's. */
  nextOf(key) {
    const lapsed = this.robot.now - 62.5 * this.robot.site.us.token_repeat;
    const open = [...(this.requests.get(key) ?? [])].filter(([, one]) => one.us > lapsed);
    return open.find(([node, one]) => !this.robot.objection(key, node, one))?.[0] ?? 0;
  }

  #refused(key, { sender, reason }) {
    const one = this.wanted.get(key);
    if (sender !== this.belief(key)[1]) return;
    const isSoon = reason === "MIRROR_BEHIND" || !isSegment(key);
    one.due = this.robot.now + this.robot.site.us.token_repeat * (isSoon ? 5 : 25);
    if (isSegment(key)) this.robot.seesOrder(reason !== "MIRROR_BEHIND");
    if (isSegment(key) && !one.isTold) this.robot.waits(key, sender, reason);
    one.isTold = true;
  }

  // --- what is told

  /** R1, R3. */
  state() {
    for (const [key, version] of this.held) this.robot.say("TokenHeld", { ...of(key), version });
    for (const [key, { version, to }] of this.leaving) this.robot.say("TokenGiven", { ...of(key), version, holder: to });
  }

  /** R4: to who was restarted, and said itself what it held and gave. */
  startsAnew(node) {
    this.before.set(node, this.stated.get(node) ?? new Map());
    this.stated.delete(node);
  }

  remind(node) {
    for (const [key, version] of this.before.get(node) ?? []) {
      if (this.belief(key)[1] === node && !this.stated.get(node)?.has(key)) this.robot.say("TokenSeen", { ...of(key), version, holder: node });
    }
    for (const [key, [giver, version, holder]] of this.unproved) {
      if (giver === node) this.robot.say("TokenSeen", { ...of(key), version, holder });
    }
  }

  /** R3: what is held by who does not live; G2: all that I saw. */
  seenOf(isWanted) {
    for (const [key, [version, holder]] of this.believed) {
      if (holder !== this.robot.node && isWanted(holder)) this.robot.say("TokenSeen", { ...of(key), version, holder });
    }
  }

  /** G3, G4: a list of rights counts. */
  assign(list) {
    for (const [key, version, holder] of list) {
      if (holder === this.robot.node) this.#hold(key, version);
      else this.believed.set(key, [version, holder]);
    }
  }
}
