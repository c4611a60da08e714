// Frames by the table that is generated from the DBC files (python -m tests.foreign.table), and what F1 to F8 ask.
import { readFileSync } from "node:fs";

const TABLE = JSON.parse(readFileSync(new URL("contract.json", import.meta.url), "utf8"));
const BUSES = Object.fromEntries(
  ["fleet", "device"].map((bus) => [
    bus,
    {
      byName: new Map(TABLE[bus].map((one) => [one.name, one])),
      byNumber: new Map(TABLE[bus].map((one) => [one.number, one])),
    },
  ]),
);
export const CONTRACT = TABLE.contract;
const MOST_OF_RUN = 16;
// Words that make one run of segments in line, and the signal of which the least is told.
const RUNS = { TokenGrant: "", TokenHeld: "", TokenRequest: "version_seen", TokenRefusal: "version" };

export function encode(bus, sender, name, signals) {
  const message = BUSES[bus].byName.get(name);
  let bits = 0n;
  for (const [signal, first, width, , factor, offset, , , names] of message.signals) {
    const value = signals[signal] ?? 0;
    const raw = typeof value === "string" ? names.indexOf(value) : Math.trunc((Number(value) - offset) / factor);
    if (raw < 0 && names.length) throw new Error(`${name}.${signal}: no value ${value}`);
    bits |= BigInt.asUintN(width, BigInt(raw)) << BigInt(first);
  }
  const data = Buffer.alloc(8);
  data.writeBigUInt64LE(bits);
  return [(message.number | sender) >>> 0, data];
}

/** The word of a frame, or why it does not count ({ fault }). */
export function decode(bus, number, data) {
  const message = BUSES[bus].byNumber.get((number & ~0xff) >>> 0);
  const sender = number & 0xff;
  if (!message || !sender) return { fault: "UNKNOWN_IDENTIFIER" };
  if (data.length < 8) return { fault: "SHORT_FRAME" };
  const bits = data.readBigUInt64LE(0);
  const word = { name: message.name, sender, senders: message.senders };
  for (const [signal, first, width, signed, factor, offset, least, most, names] of message.signals) {
    const raw = Number((signed ? BigInt.asIntN : BigInt.asUintN)(width, bits >> BigInt(first)));
    const value = raw * factor + offset;
    if (value < least || value > most || (names.length && raw >= names.length)) return { fault: "VALUE_OUT_OF_RANGE" };
    word[signal] = names.length ? names[raw] : value;
  }
  return word;
}

/** F8: a run taken apart. */
export function singles(word) {
  if (word.token_kind !== "RUN") return [word];
  const [track, first, last] = [word.token >> 16, (word.token >> 8) & 0xff, word.token & 0xff];
  const count = Math.abs(last - first) + 1;
  if (count > MOST_OF_RUN) return [];
  const step = Math.sign(last - first);
  const token = (n) => (track << 8) | (first + n * step);
  return Array.from({ length: count }, (_, n) => ({ ...word, token_kind: "SEGMENT", token: token(n) }));
}

/** F8: words [name, signals] about segments in line that say the same, joined. */
export function joined(words) {
  const runs = [];
  for (const word of words) {
    if (runs.length && goesOn(runs.at(-1), word)) runs.at(-1).push(word);
    else runs.push([word]);
  }
  return runs.map((run) => {
    const [name, first] = run[0];
    if (run.length === 1) return run[0];
    const token = ((first.token >> 8) << 16) | ((first.token & 0xff) << 8) | (run.at(-1)[1].token & 0xff);
    const signals = { ...first, token_kind: "RUN", token };
    if (RUNS[name]) signals[RUNS[name]] = Math.min(...run.map(([, one]) => one[RUNS[name]]));
    return [name, signals];
  });
}

function goesOn(run, [name, signals]) {
  const [last, one] = run.at(-1);
  const isSegments = [one, signals].every(({ token_kind }) => token_kind === "SEGMENT");
  if (name !== last || !(name in RUNS) || !isSegments) return false;
  const step = signals.token - one.token;
  const inLine = Math.abs(step) === 1 && (run.length === 1 || step === one.token - run.at(-2)[1].token);
  const same = Object.keys(one).every((key) => key === "token" || key === RUNS[name] || one[key] === signals[key]);
  return inLine && same && run.length < MOST_OF_RUN && signals.token >> 8 === one.token >> 8;
}

/** J4: CRC-16/CCITT-FALSE over 32-bit words, high byte first. */
export function crc16(words) {
  let crc = 0xffff;
  for (const word of words) {
    for (const shift of [24, 16, 8, 0]) {
      crc ^= ((word >>> shift) & 0xff) << 8;
      for (let bit = 0; bit < 8; bit++) crc = ((crc << 1) ^ (crc & 0x8000 ? 0x1021 : 0)) & 0xffff;
    }
  }
  return crc;
}
