// The page: one socket, snapshots in, commands out. What is shown is what the bus told; the page itself knows nothing.

import { Building } from "./building.js";
import { Stage } from "./draw.js";
import { Plan } from "./plan.js";

const $ = (selector) => document.querySelector(selector);
let stage = new Stage($("#picture"));
const state = { layout: null, snapshot: null, figures: null, chosen: null, call: null, socket: null, at: 0, retry: 500, paused: false };
// So long without a word on a line that is open, ms: then it is taken for lost and opened again.
const SILENT_MS = 4000;
const PACES = [0.5, 1, 2, 5, 10, 20, 60, 120, 300];

// --- the connection ---------------------------------------------------------------------------------------------------

function connect() {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const socket = new WebSocket(`${scheme}://${location.host}/live${location.search}`);
  state.socket = socket;
  socket.onopen = () => {
    state.retry = 500;
    state.at = performance.now();
    tell("connected", false);
  };
  socket.onmessage = (event) => take(JSON.parse(event.data));
  socket.onclose = lose;
}

function lose() {
  tell("connection lost, trying again", true);
  setTimeout(connect, state.retry);
  state.retry = Math.min(3000, state.retry * 2);
}

function tell(words, lost) {
  $("#link").textContent = words;
  $("#link").classList.toggle("lost", lost);
  document.body.classList.toggle("is-lost", lost);
}

// A line that nobody closed can be dead all the same: a cable, a sleeping computer. A pause is no silence.
setInterval(() => {
  const quiet = performance.now() - state.at > SILENT_MS;
  if (!quiet || state.socket?.readyState !== WebSocket.OPEN || !state.snapshot || state.paused) return;
  // Who says nothing may not answer a farewell either.
  state.socket.onclose = state.socket.onmessage = null;
  state.socket.close();
  lose();
}, 1000);

function take(told) {
  if (told.layout) {
    state.layout = told.layout;
    const Drawn = told.layout.plan ? Plan : told.layout.building ? Building : Stage;
    stage = new Drawn($("#picture"));
    stage.setLayout(told.layout);
    begin(told.layout);
  }
  if (told.figures) state.figures = told.figures;
  if (told.answer !== undefined) {
    $("#answer").textContent = told.answer;
    $("#answer").classList.toggle("bad", !told.ok);
  }
  if (told.snapshot) {
    state.snapshot = told.snapshot;
    state.at = performance.now();
    show();
  }
}

function send(command, values = {}) {
  if (state.socket?.readyState === WebSocket.OPEN) state.socket.send(JSON.stringify({ command, arguments: values }));
}

function begin(layout) {
  document.title = `${layout.site}: fleet`;
  $("#site").textContent = layout.site;
  $("#mode").textContent = layout.mode;
  const can = new Set(layout.commands);
  for (const one of document.querySelectorAll("[data-needs]")) one.hidden = !can.has(one.dataset.needs);
  $("#controls").hidden = can.size === 0;
  $("#noun").textContent = layout.noun;
  $("#slider").hidden = layout.mode !== "log";
  $("#picture").setAttribute("aria-label", `${layout.plan ? "plan" : "elevation"} of the site; the table of machines tells the same`);
  $("#trouble select").replaceChildren(...layout.machines.map((machine) => new Option(machine.name, machine.name)));
  $("#blockable").replaceChildren(...(layout.blockable ?? []).map((name) => new Option(name)));
  state.chosen = state.call = state.place = null;
}

// --- the tables -------------------------------------------------------------------------------------------------------

function clock(us) {
  const zero = state.snapshot.zero_s ?? 0;
  const seconds = Math.floor(us / 1e6 + zero);
  const part = (value) => String(((value % 60) + 60) % 60).padStart(2, "0");
  return `${String(((Math.floor(seconds / 3600) % 24) + 24) % 24).padStart(2, "0")}:${part(Math.floor(seconds / 60))}:${part(seconds)}`;
}

function rows(body, lines, key, choose) {
  const old = new Map([...body.children].map((row) => [row.dataset.key, row]));
  const fresh = lines.map((line) => {
    const row = old.get(String(line[key])) ?? document.createElement("tr");
    row.dataset.key = line[key];
    row.tabIndex = 0;
    row.onclick = () => choose(line);
    row.onkeydown = (event) => event.key === "Enter" && choose(line);
    line.cells.forEach((text, number) => {
      const cell = row.children[number] ?? row.appendChild(document.createElement("td"));
      if (cell.textContent !== text) cell.textContent = text;
    });
    row.classList.toggle("chosen", Boolean(line.chosen));
    return row;
  });
  if (fresh.length !== body.children.length || fresh.some((row, number) => body.children[number] !== row)) body.replaceChildren(...fresh);
}

function show() {
  const { snapshot, layout } = state;
  $("#clock").textContent = clock(snapshot.now_us);
  $("#clock").dataset.us = snapshot.now_us;
  state.paused = snapshot.pace === 0;
  $("#pace").textContent = snapshot.pace === undefined ? "" : state.paused ? "paused" : `${snapshot.pace} x`;
  $('[data-command="pause"]').textContent = state.paused ? "go on" : "pause";
  if (snapshot.span_us) $("#slider input").value = Math.round((1000 * (snapshot.now_us - snapshot.span_us[0])) / Math.max(1, snapshot.span_us[1] - snapshot.span_us[0]));
  rows($("#machines tbody"), layout.machines.map((machine) => {
    const told = snapshot.machines[machine.node];
    const wait = told.wait ? `${told.wait.for ?? ""} ${told.wait.why}`.trim() : "";
    return { node: machine.node, chosen: state.chosen === machine.node, cells: [machine.name, told.state, told.where, told.car ?? "", wait] };
  }), "node", (line) => chooseMachine(line.node));
  rows($("#tasks tbody"), snapshot.tasks.map((task) => ({
    task: task.task, cells: [task.task, task.at, task.what, task.phase, task.owner ?? "", `${Math.round((snapshot.now_us - task.since_us) / 1e6)} s`],
    owner: layout.machines.find((one) => one.name === task.owner)?.node,
  })), "task", (line) => (line.owner === undefined ? chooseCall(snapshot.calls.findLast((call) => call.task === line.task)?.id) : chooseMachine(line.owner)));
  $("#promised").hidden = !snapshot.promises;
  rows($("#promises tbody"), (snapshot.promises ?? []).map((one) => ({
    car: one.car, cells: [one.car, one.at, one.ready_us === null ? "" : clock(one.ready_us), `${(one.spread_us / 1e6).toFixed(1)} s`],
  })), "car", (line) => chooseMachine(layout.machines.find((machine) => machine.name === line.cells[1]).node));
  showCalls();
  showEvents();
  showFigures();
  showDetails();
}

function cost(call, bid) {
  return bid.cost.end_us !== undefined ? `${((bid.cost.end_us - call.opened_us) / 1e6).toFixed(1)} s` : bid.cost.unit === "ct" ? (bid.cost.number / 100).toFixed(2) : `${bid.cost.number} ${bid.cost.unit}`;
}

// Lines stay the same elements as long as they are shown: whoever goes through them by keyboard is not thrown out.
function showCalls() {
  const box = $("#calls");
  const old = new Map([...box.children].map((line) => [line.dataset.call, line]));
  const lines = state.snapshot.calls.slice().reverse().map((call) => {
    const line = old.get(call.id) ?? document.createElement("div");
    const told = JSON.stringify([call, state.call === call.id]);
    if (line.told === told) return line;
    line.told = told;
    line.dataset.call = call.id;
    line.className = `call${call.won ? " won" : call.result ? " over" : ""}${state.call === call.id ? " chosen" : ""}`;
    line.tabIndex = 0;
    line.setAttribute("role", "button");
    line.onclick = () => chooseCall(call.id);
    line.onkeydown = (event) => event.key === "Enter" && chooseCall(call.id);
    const when = document.createElement("time");
    when.textContent = clock(call.opened_us);
    line.replaceChildren(when, `${call.by}: ${call.what}${call.thing ? ` ${call.thing}` : ""} `);
    const best = call.bids.at(-1);
    for (const bid of call.bids) {
      const word = document.createElement("span");
      word.className = `bid${bid === best ? " best" : ""}`;
      word.textContent = `${bid.by} ${cost(call, bid)}`;
      line.append(word);
    }
    if (call.result) line.append(call.won ? `→ ${call.winner}` : `(${call.result})`);
    return line;
  });
  if (lines.length !== box.children.length || lines.some((line, number) => box.children[number] !== line)) box.replaceChildren(...lines);
}

function showEvents() {
  $("#events").replaceChildren(...state.snapshot.events.slice().reverse().map(([us, text]) => {
    const line = document.createElement("li");
    const when = document.createElement("time");
    when.textContent = clock(us);
    line.append(when, text);
    return line;
  }));
}

function showFigures() {
  const { snapshot, figures } = state;
  const told = Object.entries(snapshot.figures);
  if (figures?.slack) {
    told.push(["messages a task", figures.messages_per_task.toFixed(0)], ["empty travel", `${(figures.robots_empty_share * 100).toFixed(0)} %`]);
    told.push(["give-ways", figures.give_ways], ["promised minus actual", figures.slack.count ? `${figures.slack.mean_s.toFixed(1)} s` : "none"]);
  } else if (figures) {
    told.push(["frames a task", figures.messages_per_task?.toFixed(0) ?? "none"], ["call to end, mean", figures.mean_time_s === null ? "none" : `${figures.mean_time_s.toFixed(0)} s`]);
  }
  if (snapshot.waiting) told.push(["waiting in, mean", snapshot.waiting.in_s === null ? "none" : `${snapshot.waiting.in_s.toFixed(0)} s`], ["waiting out, mean", snapshot.waiting.out_s === null ? "none" : `${snapshot.waiting.out_s.toFixed(0)} s`]);
  const list = $("#figures");
  list.replaceChildren(...told.flatMap(([name, value]) => {
    const term = document.createElement("dt");
    const text = document.createElement("dd");
    term.textContent = name;
    text.textContent = value;
    text.dataset.figure = name;
    return [term, text];
  }));
  $("#charts").replaceChildren(...state.layout.series.map((name, number) =>
    chart(name, snapshot.chart.map((row) => row[number + 1]), name === "bus load" ? (value) => `${(value * 100).toFixed(2)} %` : String)));
}

function chart(name, values, words) {
  const box = document.createElement("div");
  box.className = "chart";
  const most = Math.max(...values, 1e-9);
  const points = values.map((value, number) => `${(100 * number) / Math.max(1, values.length - 1)},${38 - (34 * value) / most}`).join(" ");
  box.innerHTML = `<svg viewBox="0 0 100 40" preserveAspectRatio="none" aria-hidden="true"><polyline points="${points}"/></svg>`;
  const text = document.createElement("span");
  text.textContent = `${name}: ${words(values.at(-1) ?? 0)}`;
  box.append(text);
  return box;
}

// --- details ----------------------------------------------------------------------------------------------------------

function chooseMachine(node) {
  state.chosen = state.chosen === node ? null : node;
  state.call = state.place = null;
  show();
}

function chooseCall(id) {
  state.call = state.call === id ? null : id ?? null;
  state.chosen = state.place = null;
  show();
}

// A place or shape of the drawing: what is there is told anew with every snapshot.
function placeLines() {
  const { what, id } = state.place;
  if (what === "place") {
    const car = state.snapshot.cars?.[id];
    const kind = state.layout.classes?.[id] ? `, ${state.layout.classes[id]}${state.layout.charging.includes(id) ? ", to charge" : ""}` : "";
    return [`place p(${id >> 8},${id & 127})${(id >> 7) & 1 ? "F" : "N"}${kind}: ${car ? `car ${car}` : "free"}`];
  }
  if (what === "segment") {
    const [track, index] = id.match(/\d+/g).map(Number);
    const holder = state.layout.machines.find((one) => state.snapshot.machines[one.node].holds?.some(([k, i]) => k === track && i === index));
    const blocked = state.snapshot.blocked?.some(([k, i]) => k === track && i === index);
    return [`segment ${id}: ${blocked ? "blocked" : holder ? `held by ${holder.name}` : "free"}`];
  }
  const shape = state.layout.plan?.shapes.find((one) => one.id === id);
  const mark = state.snapshot.marks?.[id] ?? {};
  const held = state.layout.machines.filter((one) => state.snapshot.machines[one.node].held?.some(([held]) => held === id));
  const lines = [shape ? `${shape.kind} ${shape.name}` : id, ...(mark.lines ?? [])];
  if (held.length) lines.push(`held by ${held.map((one) => one.name).join(", ")}`);
  return lines;
}

function showDetails() {
  const box = $("#details");
  const lines = state.call !== null ? callLines() : state.chosen !== null ? machineLines() : state.place ? placeLines() : [];
  box.hidden = lines.length === 0;
  box.querySelector("div").replaceChildren(...lines.map((text) => {
    const line = document.createElement("p");
    line.style.margin = ".15em 0";
    line.textContent = text;
    return line;
  }));
}

function machineLines() {
  const { snapshot, layout } = state;
  const machine = layout.machines.find((one) => one.node === state.chosen);
  const told = snapshot.machines[machine.node];
  const lines = [`${machine.name}: ${machine.kind}, node ${machine.node}, ${told.state}, at ${told.where}`];
  if (told.car) lines.push(`${layout.noun} ${told.car} in hand`);
  if (told.wait) lines.push(`waits for p(${told.wait.at.join(",")})${told.wait.for ? ` of ${told.wait.for}` : ""}: ${told.wait.why}`);
  if (told.holds?.length) lines.push(`holds ${told.holds.map(([track, index]) => `p(${track},${index})`).join(" ")}`);
  for (const [us, words] of told.told ?? []) lines.push(us === null ? words : `${clock(us)}: ${words}`);
  for (const [track, from, to, begin, end] of told.plan ?? []) lines.push(`${clock(begin)} to ${clock(end)}: ${track >= 128 ? "lift or spur" : "floor"} ${track}, ${from} to ${to}`);
  const seals = Object.entries(told.seals ?? {}).map(([mark, count]) => `${count} ${mark}`);
  if (seals.length) lines.push(`frames: ${seals.join("; ")}`);
  if (told.battery) lines.push(batteryLine(told.battery));
  if (told.desk) lines.push(`the desk shows: ${told.desk}`);
  if (told.doors) lines.push(`street door ${told.doors.input}, alley door ${told.doors.output}, light ${told.doors.light}`);
  const task = snapshot.tasks.find((one) => one.owner === machine.name);
  if (task) lines.push(`works on task ${task.task} (${task.what}, ${task.phase})${task.promised_us ? `, promised for ${clock(task.promised_us)}` : ""}`);
  return lines;
}

function batteryLine(battery) {
  if (!battery.percent) return "battery empty: it stands";
  return `battery ${battery.percent.toFixed(0)} %${battery.charging ? ", charging" : ""}${battery.bids ? "" : ", charges first"}`;
}

function callLines() {
  const call = state.snapshot.calls.find((one) => one.id === state.call);
  if (!call) return ["this call is long over"];
  const lines = [`call ${call.id} of ${call.by}: ${call.what}${call.thing ? ` ${call.thing}` : ""}, from ${call.from} to ${call.to}`, `opened ${clock(call.opened_us)}${call.deadline_us ? `, deadline ${clock(call.deadline_us)}` : ""}${call.attempt > 1 ? `, attempt ${call.attempt}` : ""}`];
  for (const bid of call.bids) lines.push(`${bid.by} bids ${cost(call, bid)} after ${((bid.at_us - call.opened_us) / 1e3).toFixed(0)} ms`);
  lines.push(call.result ? (call.won ? `won by ${call.winner}: the best bid heard` : `ended: ${call.result}${call.reason ? `, ${call.reason}` : ""}`) : "open");
  return lines;
}

// --- people -----------------------------------------------------------------------------------------------------------

function pace(step) {
  const now = state.snapshot?.pace || 1;
  const next = step > 0 ? PACES.find((one) => one > now) : PACES.findLast((one) => one < now);
  if (next) send("speed", { factor: next });
}

function act(command) {
  if (command === "pause") send(state.paused ? "resume" : "pause");
  else if (command === "slower") pace(-1);
  else if (command === "faster") pace(1);
  else if (command === "repair") send("repair", { machine: $("#trouble select").value });
  else if (command === "clear") send("clear", { place: $("#trouble [name=place]").value });
  else send(command);
}

document.addEventListener("click", (event) => {
  const button = event.target.closest("button[data-command]");
  if (button) act(button.dataset.command);
});

for (const form of document.querySelectorAll("form[data-command]")) {
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const values = Object.fromEntries([...new FormData(form)].map(([name, value]) => [name, name === "machine" || name === "place" ? value : Number(value)]));
    send(form.dataset.command, values);
  });
}

$("#slider input").addEventListener("input", (event) => {
  const [from, to] = state.snapshot.span_us;
  send("seek", { to_us: Math.round(from + ((to - from) * event.target.value) / 1000) });
});

document.addEventListener("keydown", (event) => {
  if (event.target.matches("input, select, textarea") || event.ctrlKey || event.metaKey || event.altKey) return;
  const keys = { " ": "pause", "-": "slower", "+": "faster", "=": "faster", i: "car_in", o: "car_out" };
  const needs = { pause: "pause", slower: "speed", faster: "speed" }[keys[event.key]] ?? keys[event.key];
  if (needs && state.layout?.commands.includes(needs)) {
    if (event.target.matches("button") && event.key === " ") return;
    event.preventDefault();
    act(keys[event.key]);
  }
  if (event.key === "Escape") { state.chosen = state.call = state.place = null; show(); }
  if (event.key === "ArrowDown" || event.key === "ArrowUp") {
    const nodes = state.layout.machines.map((machine) => machine.node);
    const at = nodes.indexOf(state.chosen) + (event.key === "ArrowDown" ? 1 : -1);
    state.chosen = nodes[(at + nodes.length) % nodes.length];
    event.preventDefault();
    show();
  }
});

$("#picture").addEventListener("click", (event) => {
  const box = event.target.getBoundingClientRect();
  const hit = stage.hit(event.clientX - box.left, event.clientY - box.top);
  state.call = null;
  state.place = null;
  if (hit?.what === "machine") return chooseMachine(hit.id);
  state.chosen = null;
  if (hit) state.place = { what: hit.what, id: hit.id };
  const shape = state.layout.plan?.shapes.find((one) => one.id === hit?.id);
  const name = shape ? shape.name : hit?.id;
  if (state.layout.blockable?.includes(name)) $("#trouble [name=place]").value = name;
  show();
});

function frame() {
  if (state.snapshot) {
    const passed = (performance.now() - state.at) * 1000 * (state.snapshot.pace ?? 1);
    stage.draw(state.snapshot, state.snapshot.now_us + Math.min(passed, 500_000 * Math.max(1, state.snapshot.pace ?? 1)), state.chosen);
  }
  requestAnimationFrame(frame);
}

new ResizeObserver(() => stage.resize()).observe($("#stage"));
connect();
requestAnimationFrame(frame);
