// The tokens of one machine (chapter 8): all that it knows of one stands in one record, by kind << 24 | number.
const KINDS = ["SEGMENT", "STATION", "CAR", "TASK"];
const LOW = 0xfffff;
export const stationKey = (place) => (1 << 24) | place;
export const carKey = (car) => (2 << 24) | car;
export const keyOf = ({ token_kind, token }) => (KINDS.indexOf(token_kind) << 24) | token;
export const isSegment = (key) => key < 1 << 24;

export class Tokens {
  constructor(robot, kept = []) {
    Object.assign(this, { robot, node: robot.node, all: new Map() });
    this.repeatUs = robot.site.us.token_repeat;
    for (const one of kept) Object.assign(this.get(one.key), one);
  }

  /** Of each: the newest version and its holder, as a chain tells (K6); the last give; the grant under way. */
  journal() {
    return [...this.all.values()].map(({ key, version, holder, given, leaving }) => {
      return { key, version, holder, given, leaving: leaving && { ...leaving, times: 0, due: 0 } };
    });
  }

  get(key) {
    if (!this.all.has(key)) this.all.set(key, { key, version: 0, holder: this.#firstHolder(key), open: new Map() });
    return this.all.get(key);
  }

  /** K1. */
  #firstHolder(key) {
    const { keeper, homes, stewards } = this.robot.site;
    if (isSegment(key)) return homes.get(key) ?? stewards.get(key >> 8);
    return key >> 24 === 1 ? keeper(key & 0xffff) : (key >> 16) & 0xff;
  }

  holds = (key) => this.get(key).holder === this.node;
  /** Those that I hold, but for what was never given. */
  mine = () => [...this.all.values()].filter((one) => one.holder === this.node && one.version);
  /** Of those the ones in line with a segment, 15 to either side. */
  inLine(key) {
    return this.mine().filter((one) => isSegment(key) && one.key >> 8 === key >> 8 && Math.abs(one.key - key) < 16);
  }

  #say = (name, { key, version }, signals = {}) =>
    this.robot.say(name, { token_kind: KINDS[key >> 24], token: key & 0xffffff, version, ...signals });

  // --- what is said by itself

  /** K3, K9: what the robot needs now is asked for, what is under way is granted again. */
  wake(needed) {
    const { robot } = this;
    for (const key of needed) if (!this.holds(key)) this.get(key).want ??= { times: 0, due: 0 };
    for (const one of this.all.values()) {
      if (!needed.has(one.key)) one.want = undefined;
      const isAsked = one.want && this.#isAgain(one.want);
      if (isAsked) this.#say("TokenRequest", one, { version_seen: one.version & LOW, ...robot.claim(one.key) });
      if (robot.synced && one.leaving && this.#isAgain(one.leaving)) this.#grant(one);
    }
  }

  #isAgain(one) {
    if (!this.robot.isDue(one.due)) return false;
    one.times += 1;
    one.due = this.robot.now + Math.min(25, 2 ** Math.max(0, one.times - 3)) * this.repeatUs;
    return this.robot.isDue(one.due) || true;
  }

  #grant(one) {
    const [version, holder] = one.given;
    one.leaving.said = this.robot.now;
    if (one.leaving.carAt) this.robot.say("CarAt", one.leaving.carAt);
    this.#say("TokenGrant", one, { version, holder });
  }

  /** K3, K4: several at once, so that what goes together has one version. */
  give(keys, to, carAt = undefined) {
    const versions = keys.flatMap((key) => [this.get(key), ...this.inLine(key)]).map((one) => one.version);
    const version = Math.max(...versions) + 1;
    this.robot.save();
    for (const one of keys.map((key) => this.get(key))) {
      const leaving = { times: 1, due: this.robot.now + this.repeatUs, carAt };
      Object.assign(one, { version, holder: to, given: [version, to], leaving, by: 0 });
      one.open.delete(to);
      this.#grant(one);
    }
  }

  /** R1, R3. */
  state() {
    for (const one of this.mine()) this.#say("TokenHeld", one);
    for (const one of this.all.values()) if (one.leaving) this.#answer(one);
  }

  /** R3: what is held by who does not live; R4: what who was restarted said in its life before; G2: all. */
  tellSeen(isWanted) {
    for (const one of this.all.values()) {
      if (!this.holds(one.key) && one.version && isWanted(one)) this.#say("TokenSeen", one, { holder: one.holder });
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
    const [isMine, isToMe] = [this.holds(one.key), word.holder === this.node];
    const isStated = /Held|Given|Seen/.test(name) && robot.isComparing(sender);
    if (isStated && isMine && version > one.version) robot.isOutdated();
    if (name === "TokenRequest") this.#requested(one, word);
    else if (name === "TokenRefusal" && word.requester === this.node) this.#refused(one, word);
    else if (name === "TokenDispute" && word.believed === this.node) this.#answer(one);
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
    const { sender, version } = word;
    if (!this.robot.mayTake()) return;
    if (this.holds(one.key) || version <= one.given?.[0]) this.#answer(one);
    else if (sender !== one.holder) {
      one.disputed = word;
      this.#say("TokenDispute", one, { version, believed: one.holder });
    } else if (version > one.version) {
      if (isSegment(one.key)) this.robot.seesOrder(true);
      this.#know(one, version, this.node, 0);
      this.#answer(one);
    }
  }

  /** K6, K8: who says that it holds it, whom I believe to, or whom I asked for all. */
  #stated(one, sender, version) {
    const isKnown = sender === one.holder || this.robot.peers.get(sender).isAsked;
    if (version < one.version) this.#say("TokenSeen", one, { holder: one.holder });
    else if (isKnown) this.#know(one, version, sender, sender);
  }

  #know(one, version, holder, by) {
    const { disputed } = one;
    Object.assign(one, { version, holder, by, life: this.robot.peers.get(by)?.boot, disputed: undefined });
    if (version >= one.given?.[0]) one.leaving = undefined;
    if (holder === this.node) one.want = undefined;
    this.robot.save();
    if (disputed && holder !== this.node) this.#offered(one, disputed);
  }

  #answer(one) {
    const [version, holder] = one.given ?? [];
    if (this.holds(one.key)) this.#say("TokenHeld", one);
    else if (version) this.#say("TokenGiven", one, { version, holder });
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
    if (!reason && isSegment(one.key)) robot.sayPlace();
    if (!reason) this.give([one.key], sender);
    else this.#say("TokenRefusal", one, { version: one.version & LOW, requester: sender, reason });
  }

  /** Whose turn it is by its request, the oldest first; 0 for nobody's. */
  nextOf(key) {
    const open = [...this.get(key).open].filter(([, one]) => one.us > this.robot.now - 62.5 * this.repeatUs);
    return open.find(([node, one]) => !this.robot.objection(key, node, one))?.[0] ?? 0;
  }

  #refused(one, { sender, reason }) {
    const { robot } = this;
    if (sender !== one.holder || !one.want) return;
    const isSoon = reason === "MIRROR_BEHIND" || !isSegment(one.key);
    one.want.due = robot.now + this.repeatUs * (isSoon ? 5 : 25);
    if (!isSegment(one.key)) return;
    robot.seesOrder(reason !== "MIRROR_BEHIND");
    if (!one.want.isTold) robot.waits(one.key, sender, reason);
    one.want.isTold = true;
  }
}
