// The robot made faulty: what it says, hears or does is changed from outside, by the name of the fault.
const task = ({ task_origin: origin, task_number: number }) => origin * 65_536 + number;
const says = (robot, change) => {
  const { say } = robot;
  robot.say = (name, signals) => change(name, signals, (changed = signals) => say.call(robot, name, changed));
};
const each = (robot, name, add) =>
  says(robot, (said, signals, say) => {
    say();
    if (said === name && robot.now > 20e6) add(robot);
  });
const segments = (robot) => [...robot.site.length].flatMap(([track, length]) => Array.from({ length }, (_, n) => (track << 8) | (n + 1)));

export const FAULTS = {
  /** Promises to be twenty seconds sooner than it will be. */
  underbids: (robot) => says(robot, (name, signals, say) => say(name === "Bid" ? { ...signals, cost: signals.cost - 20_000 } : signals)),
  /** Bids, and never answers an award. */
  deaf: (robot) => {
    const { hear } = robot;
    robot.hear = (word, peer) => word.name !== "Award" && hear.call(robot, word, peer);
  },
  /** Gives back each task that it wins. */
  refuses: (robot) => {
    const { hear } = robot;
    robot.hear = (word, peer) => (word.name === "Award" && word.winner === robot.node ? robot.forfeit(task(word), "IMPOSSIBLE") : hear.call(robot, word, peer));
  },
  /** Tells no plan but the first. */
  planless: (robot) => says(robot, (name, signals, say) => (name.startsWith("Itinerary") && signals.version > 1 ? undefined : say())),
  /** Its digest is never anybody's. */
  differs: (robot) => says(robot, (name, signals, say) => say(name === "Heartbeat" ? { ...signals, mirror_digest: signals.mirror_digest ^ 0x5555 } : signals)),
  /** Says that it holds what is others', and grants that to itself. */
  claims: (robot) =>
    each(robot, "Heartbeat", () => {
      const others = segments(robot).filter((one) => !robot.tokens.holds(one));
      for (const token of others.slice(0, 6)) robot.say("TokenHeld", { token_kind: "SEGMENT", token, version: 9_000 });
      for (const token of others.slice(6, 12)) robot.say("TokenGrant", { token_kind: "SEGMENT", token, version: 9_000, holder: robot.node });
    }),
  /** Asks for every segment of the site, needed or not. */
  greedy: (robot) =>
    each(robot, "Heartbeat", () => {
      for (const token of segments(robot)) robot.say("TokenRequest", { token_kind: "SEGMENT", token, version_seen: 0, itinerary_version: robot.version, predecessor: 0 });
    }),
  /** Frames that are unknown, short and out of range, a hundred a beat. */
  babbles: (robot) =>
    each(robot, "Heartbeat", () => {
      for (let n = 0; n < 50; n++) robot.frames.push(["fleet", 0x1f000000 + (n << 8) + robot.node, Buffer.alloc(n % 8)], ["fleet", 0x01100000 + robot.node, Buffer.alloc(8, 0xff)]);
    }),
  /** At rest after a minute and a half it falls silent, and stays so. */
  dies: (robot) => {
    const { step } = robot;
    robot.step = (...given) => {
      robot.isDead ||= robot.now > 90e6 && robot.steps.length === 0;
      return robot.isDead ? [] : step.apply(robot, given);
    };
  },
  /** Bids whatever others have bid. */
  unbeaten: (robot) => {
    const { hear } = robot;
    robot.hear = (word, peer) => word.name !== "Bid" && hear.call(robot, word, peer);
  },
  /** Is of another contract. */
  stranger: (robot) => says(robot, (name, signals, say) => say(name === "Heartbeat" ? { ...signals, contract: 1 } : signals)),
  /** Its bus time is ten seconds fast. */
  fast: (robot) => {
    const { step } = robot;
    robot.step = (...given) => {
      if (robot.offset !== undefined && !robot.isFast) [robot.isFast, robot.offset] = [true, robot.offset + 10e6];
      return step.apply(robot, given);
    };
  },
};
