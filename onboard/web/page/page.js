// The page: one socket, snapshots in, commands out. What is shown is what the bus told; the page itself knows nothing.

import { Stage } from "./draw.js";

const $ = (selector) => document.querySelector(selector);
const stage = new Stage($("#picture"));
const state = { layout: null, snapshot: null, figures: null, chosen: null, call: null, socket: null, at: 0, retry: 500, paused: false };
const PACES = [0.5, 1, 2, 5, 10, 20, 60, 120, 300];

// --- the connection ---------------------------------------------------------------------------------------------------

function connect() {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const socket = new WebSocket(`${scheme}://${location.host}/live${location.search}`);
  state.socket = socket;
  socket.onopen = () => {
    state.retry = 500;
    tell("connected", false);
  };
  socket.onmessage = (event) => take(JSON.parse(event.data));
  socket.onclose = () => {
    tell("connection lost, trying again", true);
    setTimeout(connect, state.retry);
    state.retry = Math.min(8000, state.retry * 2);
  };
}

function tell(words, lost) {
  $("#link").textContent = words;
  $("#link").classList.toggle("lost", lost);
}

function take(told) {
  if (told.layout) {
    state.layout = told.layout;
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
  document.body.classList.toggle("is-simulated", layout.mode === "simulated");
  $("#controls").hidden = layout.mode === "live";
  $("#slider").hidden = layout.mode !== "log";
  const select = $("#trouble select");
  select.replaceChildren(...layout.machines.map((machine) => new Option(machine.name, machine.name)));
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

function place(machine) {
  const track = state.layout.tracks.find((one) => one.number === machine.track);
  if (!track) return "";
  if (track.kind === "lift") return `floor ${track.joins[Math.max(0, Math.min(track.joins.length, machine.index) - 1)][0]}`;
  return `p(${machine.track},${machine.index})`;
}

function show() {
  const { snapshot, layout } = state;
  $("#clock").textContent = clock(snapshot.now_us);
  state.paused = snapshot.pace === 0;
  $("#pace").textContent = snapshot.pace === undefined ? "" : state.paused ? "paused" : `${snapshot.pace} x`;
  $('[data-command="pause"]').textContent = state.paused ? "go on" : "pause";
  if (snapshot.span_us) $("#slider input").value = Math.round((1000 * (snapshot.now_us - snapshot.span_us[0])) / Math.max(1, snapshot.span_us[1] - snapshot.span_us[0]));
  rows($("#machines tbody"), layout.machines.map((machine) => {
    const told = snapshot.machines[machine.node];
    const wait = told.wait ? `${told.wait.for ?? ""} ${told.wait.why}`.trim() : "";
    return { node: machine.node, chosen: state.chosen === machine.node, cells: [machine.name, told.state, place(told), told.car ?? "", wait] };
  }), "node", (line) => chooseMachine(line.node));
  rows($("#tasks tbody"), snapshot.tasks.map((task) => ({
    task: task.task, cells: [task.task, task.at, task.what, task.phase, task.owner ?? "", `${Math.round((snapshot.now_us - task.since_us) / 1e6)} s`],
  })), "task", () => {});
  showCalls();
  showEvents();
  showFigures();
  showDetails();
}

function cost(call, bid) {
  return bid.cost.end_us !== undefined ? `${((bid.cost.end_us - call.opened_us) / 1e6).toFixed(1)} s` : `${bid.cost.number} ${bid.cost.unit}`;
}

function showCalls() {
  const lines = state.snapshot.calls.slice().reverse().map((call) => {
    const line = document.createElement("div");
    line.className = `call${call.won ? " won" : call.result ? " over" : ""}`;
    line.dataset.call = call.id;
    line.onclick = () => { state.call = call.id; state.chosen = null; showDetails(); };
    const when = document.createElement("time");
    when.textContent = clock(call.opened_us);
    line.append(when, `${call.by}: ${call.what}${call.car ? ` car ${call.car}` : ""} `);
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
  $("#calls").replaceChildren(...lines);
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
  const told = [["parked", snapshot.figures.parked], ["fetched", snapshot.figures.fetched], ["calls", snapshot.figures.calls], ["bids", snapshot.figures.bids]];
  if (figures) {
    told.push(["messages a task", figures.messages_per_task.toFixed(0)], ["empty travel", `${(figures.robots_empty_share * 100).toFixed(0)} %`]);
    told.push(["give-ways", figures.give_ways], ["promised minus actual", figures.slack.count ? `${figures.slack.mean_s.toFixed(1)} s` : "none"]);
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
  const series = [["bus load", 1, (value) => `${(value * 100).toFixed(2)} %`], ["open tasks", 2, String], ["parked", 3, String], ["fetched", 4, String]];
  $("#charts").replaceChildren(...series.map(([name, column, words]) => chart(name, snapshot.chart.map((row) => row[column]), words)));
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
  state.call = null;
  show();
}

function showDetails() {
  const box = $("#details");
  const lines = state.call !== null ? callLines() : state.chosen !== null ? machineLines() : state.place ? [state.place] : [];
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
  const lines = [`${machine.name}: ${machine.kind}, node ${machine.node}, ${told.state}, at ${place(told)}`];
  if (told.car) lines.push(`carries car ${told.car}`);
  if (told.wait) lines.push(`waits for p(${told.wait.at.join(",")})${told.wait.for ? ` of ${told.wait.for}` : ""}: ${told.wait.why}`);
  if (told.holds.length) lines.push(`holds ${told.holds.map(([track, index]) => `p(${track},${index})`).join(" ")}`);
  for (const [track, from, to, begin, end] of told.plan) lines.push(`${clock(begin)} to ${clock(end)}: ${track >= 128 ? "lift or spur" : "floor"} ${track}, ${from} to ${to}`);
  if (told.doors) lines.push(`street door ${told.doors.input}, alley door ${told.doors.output}, light ${told.doors.light}`);
  const task = snapshot.tasks.find((one) => one.owner === machine.name);
  if (task) lines.push(`works on task ${task.task} (${task.what}, ${task.phase})${task.promised_us ? `, promised for ${clock(task.promised_us)}` : ""}`);
  return lines;
}

function callLines() {
  const call = state.snapshot.calls.find((one) => one.id === state.call);
  if (!call) return ["this call is long over"];
  const lines = [`call ${call.id} of ${call.by}: ${call.what}${call.car ? ` car ${call.car}` : ""}, from ${call.from} to ${call.to}`, `opened ${clock(call.opened_us)}${call.deadline_us ? `, deadline ${clock(call.deadline_us)}` : ""}${call.attempt > 1 ? `, attempt ${call.attempt}` : ""}`];
  for (const bid of call.bids) lines.push(`${bid.by} bids ${cost(call, bid)} after ${((bid.at_us - call.opened_us) / 1e3).toFixed(0)} ms`);
  lines.push(call.result ? (call.won ? `won by ${call.winner}: the best bid heard` : `ended: ${call.result}`) : "open");
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
  else send(command);
}

document.addEventListener("click", (event) => {
  const button = event.target.closest("button[data-command]");
  if (button) act(button.dataset.command);
});

for (const form of document.querySelectorAll("form[data-command]")) {
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const values = Object.fromEntries([...new FormData(form)].map(([name, value]) => [name, name === "machine" ? value : Number(value)]));
    send(form.dataset.command, values);
  });
}

$("#slider input").addEventListener("input", (event) => {
  const [from, to] = state.snapshot.span_us;
  send("seek", { to_us: Math.round(from + ((to - from) * event.target.value) / 1000) });
});

document.addEventListener("keydown", (event) => {
  if (event.target.matches("input, select") || event.ctrlKey || event.metaKey || event.altKey) return;
  const keys = { " ": "pause", "-": "slower", "+": "faster", "=": "faster", i: "car_in", o: "car_out" };
  if (keys[event.key] && (state.layout?.mode === "simulated" || (state.layout?.mode === "log" && !"io".includes(event.key)))) {
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
  if (hit) state.place = `place p(${hit.id >> 8},${hit.id & 127})${(hit.id >> 7) & 1 ? "F" : "N"}: ${hit.car ? `car ${hit.car}` : "free"}`;
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
