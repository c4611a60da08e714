// The tokens of one machine (chapter 8): all that it knows of one stands in one record, by kind << 24 | number.
const KINDS = ["SEGMENT", "STATION", "CAR", "TASK"];
const LOW = 0xfffff;
export const stationKey = (place) => (1 << 24) | place;
export const carKey = (car) => (2 << 24) | car;
export const keyOf = ({ token_kind, token }) => (KINDS.indexOf(token_kind) << 24) | token;
export const isSegment = (key) => key < 1 << 24;
const of = ({ key }) => ({ token_kind: KINDS[key >> 24], token: key & 0xffffff });

export class Tokens {
  constructor(robot, kept = []) {
    this.robot = robot;
    this.all = new Map();
    for (const one of kept) Object.assign(this.get(one.key), one);
  }

  /** Of each: the newest version and its holder, as a chain tells (K6); the last give; the grant under way. */
  journal() {
    const restarted = (leaving) => leaving && { ...leaving, times: 0, due: 0 };
    return [...this.all.values()].map(({ key, version, holder, given, leaving }) => {
      return { key, version, holder, given, leaving: restarted(leaving) };
    });
  }

  get(key) {
    if (!this.all.has(key)) this.all.set(key, { key, version: 0, holder: this.#firstHolder(key), open: new Map() });
    return this.all.get(key);
  }

  /** K1. */
  #firstHolder(key) {
    const { site } = this.robot;
    if (key >> 24 >= 2) return (key >> 16) & 0xff;
    return key >> 24 ? site.keeper(key & 0xffff) : (site.homes.get(key) ?? site.stewards.get(key >> 8));
  }

  holds(key) {
    return this.get(key).holder === this.robot.node;
  }

  /** Those that I hold, but for what was never given. */
  get mine() {
    return [...this.all.values()].filter((one) => one.holder === this.robot.node && one.version);
  }

  // --- what is said by itself

  /** K3, K9: what the robot needs now is asked for, what is under way is granted again. */
  wake(needed) {
    const { robot } = this;
    for (const key of needed) if (!this.holds(key)) this.get(key).want ??= { times: 0, due: 0 };
    for (const one of this.all.values()) {
      if (!needed.has(one.key)) one.want = undefined;
      if (one.want && this.#again(one.want)) {
        const claim = isSegment(one.key) ? robot.claim(one.key) : { itinerary_version: robot.version, predecessor: 0 };
        robot.say("TokenRequest", { ...of(one), version_seen: one.version & LOW, ...claim });
      }
      if (robot.synced && one.leaving && this.#again(one.leaving)) this.#grant(one);
    }
  }

  #again(one) {
    const { robot } = this;
    const { token_repeat: first } = robot.site.us;
    if (!robot.isDue(one.due)) return false;
    one.times += 1;
    one.due = robot.now + Math.min(25 * first, first << Math.max(0, Math.min(one.times - 3, 9)));
    return robot.isDue(one.due) || true;
  }

  #grant(one) {
    const { leaving } = one;
    leaving.said = this.robot.now;
    if (leaving.carAt) this.robot.say("CarAt", leaving.carAt);
    this.robot.say("TokenGrant", { ...of(one), version: one.given[0], holder: one.given[1] });
  }

  /** K3, K4: several at once, so that what goes together has one version. */
  give(keys, to, carAt = undefined) {
    const inLine = ({ key }) => keys.some((one) => isSegment(one) && one >> 8 === key >> 8 && Math.abs(one - key) < 16);
    const given = keys.map((key) => this.get(key));
    const version = Math.max(...[...given, ...this.mine.filter(inLine)].map((one) => one.version)) + 1;
    this.robot.save();
    for (const one of given) {
      const leaving = { times: 1, due: this.robot.now + this.robot.site.us.token_repeat, carAt };
      Object.assign(one, { version, holder: to, given: [version, to], leaving, by: 0 });
      one.open.delete(to);
      this.#grant(one);
    }
  }

  /** R1, R3. */
  state() {
    for (const one of this.mine) this.robot.say("TokenHeld", { ...of(one), version: one.version });
    for (const one of this.all.values()) if (one.leaving) this.#answer(one);
  }

  /** R3: what is held by who does not live; R4: what who was restarted said in its life before; G2: all. */
  tellSeen(isWanted) {
    for (const one of this.all.values()) {
      const { version, holder } = one;
      const isSeen = holder !== this.robot.node && version && isWanted(one);
      if (isSeen) this.robot.say("TokenSeen", { ...of(one), version, holder });
    }
  }

  /** G3, G4: a list of rights counts. */
  assign(list) {
    for (const [key, version, holder] of list) this.#know(this.get(key), version, holder, 0);
  }

  // --- what is heard

  hear(word) {
    const { robot } = this;
    const { name, sender, version } = word;
    const one = this.get(keyOf(word));
    const [isMine, isToMe] = [this.holds(one.key), word.holder === robot.node];
    const isStated = /Held|Given|Seen/.test(name);
    if (isStated && isMine && version > one.version && robot.isComparing(sender)) robot.isOutdated();
    if (name === "TokenRequest") this.#requested(one, word);
    else if (name === "TokenRefusal" && word.requester === robot.node) this.#refused(one, word);
    else if (name === "TokenDispute" && word.believed === robot.node) this.#answer(one);
    else if (name === "TokenGrant" && isToMe) this.#offered(one, word);
    else if (isMine && /Grant|Held|Given/.test(name)) {
      if (!isToMe) robot.drop("RIGHT_CLAIMED");
      this.#answer(one);
    } else if (name === "TokenHeld") this.#stated(one, sender, version);
    else if (/Grant|Given/.test(name) && !isToMe && sender === one.holder && version > one.version) {
      this.#know(one, version, word.holder, sender);
    }
  }

  /** K5, K7. */
  #offered(one, word) {
    const { robot } = this;
    const { sender, version } = word;
    if (!robot.mayTake()) return;
    if (this.holds(one.key) || version <= (one.given?.[0] ?? 0)) this.#answer(one);
    else if (sender !== one.holder) {
      one.disputed = word;
      robot.say("TokenDispute", { ...of(one), version, believed: one.holder });
    } else if (version > one.version) {
      if (isSegment(one.key)) robot.seesOrder(true);
      this.#know(one, version, robot.node, 0);
      this.#answer(one);
    }
  }

  /** K6, K8: who says that it holds it, whom I believe to, or whom I asked for all. */
  #stated(one, sender, version) {
    const { robot } = this;
    const isKnown = sender === one.holder || robot.peers.get(sender).isAsked;
    if (version < one.version) robot.say("TokenSeen", { ...of(one), version: one.version, holder: one.holder });
    else if (isKnown) this.#know(one, version, sender, sender);
  }

  #know(one, version, holder, by) {
    Object.assign(one, { version, holder, by, life: this.robot.peers.get(by)?.boot });
    if (version >= one.given?.[0]) one.leaving = undefined;
    if (holder === this.robot.node) one.want = undefined;
    this.robot.save();
    const waiting = one.disputed;
    one.disputed = undefined;
    if (waiting && holder !== this.robot.node) this.#offered(one, waiting);
  }

  #answer(one) {
    const [version, holder] = one.given ?? [];
    if (this.holds(one.key)) this.robot.say("TokenHeld", { ...of(one), version: one.version });
    else if (version) this.robot.say("TokenGiven", { ...of(one), version, holder });
  }

  /** K10, K11: every request is remembered, whoever holds the token. */
  #requested(one, { sender, itinerary_version: plan, predecessor }) {
    const { robot } = this;
    const isUnheard = one.leaving && one.holder === sender && robot.now > one.leaving.said + 20_000;
    if (isUnheard) this.#grant(one);
    one.open.delete(sender);
    one.open.set(sender, { us: robot.now, plan, predecessor });
    if (!this.holds(one.key) || !robot.mayGive()) return;
    const reason = robot.objection(one.key, sender, one.open.get(sender));
    if (!reason) this.give([one.key], sender);
    else robot.say("TokenRefusal", { ...of(one), version: one.version & LOW, requester: sender, reason });
  }

  /** Whose turn it is by its request, the oldest first; 0 for nobody's. */
  nextOf(key) {
    const lapsed = this.robot.now - 62.5 * this.robot.site.us.token_repeat;
    const open = [...this.get(key).open].filter(([, one]) => one.us > lapsed);
    return open.find(([node, one]) => !this.robot.objection(key, node, one))?.[0] ?? 0;
  }

  #refused(one, { sender, reason }) {
    const { robot } = this;
    if (sender !== one.holder || !one.want) return;
    const isSoon = reason === "MIRROR_BEHIND" || !isSegment(one.key);
    one.want.due = robot.now + robot.site.us.token_repeat * (isSoon ? 5 : 25);
    if (!isSegment(one.key)) return;
    robot.seesOrder(reason !== "MIRROR_BEHIND");
    if (!one.want.isTold) robot.waits(one.key, sender, reason);
    one.want.isTold = true;
  }
}
