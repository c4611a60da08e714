"""The messages `connection`, `state` and `visualization` of one machine (VDA 5050 2.1, sections 6.10 to 6.14).

Nobody gives these machines orders: what is told as `orderId` is the task that a machine has won, and its nodes and
edges are what its own firm plan still leads over. All of them are released: a plan is what the machine will do.
"""

from dataclasses import dataclass

from onboard.contract.codes import MachineState, Operation, TaskPhase
from onboard.contract.messages import Halted, Reference
from onboard.core.site import Segment
from onboard.gateway.dialect import Connection, Dialect, Json
from onboard.gateway.machines import Machines, MobileMachine, TaskInHand
from onboard.gateway.positions import MachinePosition
from onboard.holon.remedies import reason_words, remedy

#: A wait is told as information as long as nothing newer is heard, at most so long, us. As on the page (onboard/web).
WAIT_TOLD_US = 30_000_000
_PICKED = (TaskPhase.LOADED, TaskPhase.DONE)


@dataclass(frozen=True, slots=True)
class Subject:
    """What a message tells of, beside the machine: the order's name as its giver knows it, and refused orders."""

    order_id: str | None = None
    update_id: int | None = None
    errors: tuple[Json, ...] = ()
    actions: tuple[Json, ...] = ()


def reference_text(reference: Reference) -> str:
    """A task or car as topics and payloads name it: who named it, and the number there, such as ``1.7``."""
    return f"{reference.origin}.{reference.number}"


def connection(dialect: Dialect, state: Connection) -> Json:
    """The body of a `connection` message."""
    return {"connectionState": dialect.connection[state]}


def state(
    dialect: Dialect, machines: Machines, node: int, now_us: int, subject: Subject, does: Operation | None
) -> Json:
    """The body of a `state` message; ``does`` is what the machine's task asks for, where that is known."""
    body, where, task = machines.bodies[node], machines.where(node), machines.bodies[node].task
    began = task.began if task is not None else 0
    sequence = 2 * max(0, where.passed - began)
    nodes, edges = _way(where, sequence)
    content: Json = {
        "orderId": _order_id(task, subject),
        "orderUpdateId": _update_id(task, subject),
        "lastNodeId": where.node,
        "lastNodeSequenceId": sequence,
        "nodeStates": nodes,
        "edgeStates": edges,
        "driving": where.driving and not body.is_paused,
        "paused": body.is_paused,
        "distanceSinceLastNode": where.away_m,
        "loads": [_load(body.load)] if body.load is not None else [],
        "errors": [*_errors(machines, body, now_us), *subject.errors],
        "information": _information(machines, body, now_us),
        "operatingMode": dialect.operating_mode(
            starting=body.state is MachineState.STARTING,
            in_service=body.state is MachineState.OBSTACLE and not body.is_held,
        ),
        **dialect.power(machines.history.batteries.levels.get(node)),
        **dialect.safety(stopped=machines.is_stopped),
        **_place(dialect, where),
    }
    actions = _actions(task, does)
    if dialect.is_third:
        return content | {"actionStates": actions, "instantActionStates": list(subject.actions)}
    return content | {"actionStates": [*actions, *subject.actions]}


def visualization(dialect: Dialect, where: MachinePosition, state_header: int) -> Json:
    """The body of a `visualization` message; ``state_header`` is that of the state told last."""
    extra: Json = {"referenceStateHeaderId": state_header & 0xFFFFFFFF} if dialect.is_third else {}
    return extra | _place(dialect, where)


def _order_id(task: TaskInHand | None, subject: Subject) -> str:
    if subject.order_id is not None:
        return subject.order_id
    return reference_text(task.task) if task is not None else ""


def _update_id(task: TaskInHand | None, subject: Subject) -> int:
    if subject.update_id is not None:
        return subject.update_id
    return max(0, task.updates - 1) if task is not None else 0


def _way(where: MachinePosition, sequence: int) -> tuple[list[Json], list[Json]]:
    """Nodes and edges ahead: even and odd sequence numbers, as in an order."""
    nodes: list[Json] = []
    edges: list[Json] = []
    before = where.node
    for number, node in enumerate(where.ahead):
        at = sequence + 2 * number + 2
        nodes.append({"nodeId": node, "sequenceId": at, "released": True})
        edges.append({"edgeId": f"{before}-{node}", "sequenceId": at - 1, "released": True})
        before = node
    return nodes, edges


def _place(dialect: Dialect, where: MachinePosition) -> Json:
    """Position and velocity, where the site has coordinates."""
    if where.map_id is None:
        return {}
    return {
        dialect.position: dialect.position_of(where.map_id, where.x_m, 0.0, where.theta),
        "velocity": {"vx": where.speed_m_s, "vy": 0.0, "omega": 0.0},
    }


def _load(car: Reference) -> Json:
    return {"loadId": reference_text(car), "loadType": "car"}


def _actions(task: TaskInHand | None, does: Operation | None) -> list[Json]:
    """Taking and setting down, as far as a task has come; the predefined actions `pick` and `drop`."""
    if task is None or does not in (Operation.PARK, Operation.RETRIEVE, Operation.TRANSPORT):
        return []
    failed = task.phase in (TaskPhase.REFUSED, TaskPhase.FORFEITED)
    name = reference_text(task.task)
    found: list[Json] = []
    for kind, is_done in (("pick", task.phase in _PICKED), ("drop", task.phase is TaskPhase.DONE)):
        status = "FINISHED" if is_done else "FAILED" if failed else "WAITING"
        one = {"actionId": f"{name}-{kind}", "actionType": kind, "actionStatus": status}
        found.append(one)
    return found


def _errors(machines: Machines, body: MobileMachine, now_us: int) -> list[Json]:
    node = body.machine.node_id
    found: list[Json] = []
    word, level = machines.halted(node, now_us), machines.history.batteries.levels.get(node)
    if level is not None and level.charge_permille == 0:
        found.append(_error("batteryEmpty", "FATAL", "the battery is empty; a person must charge it"))
    if word is not None:
        found.append(_halted(machines, word))
    if machines.is_silent(node, now_us):
        found.append(_error("machineSilent", "FATAL", "no sign of life on the bus"))
    elif word is None and body.state is MachineState.STOPPED:
        found.append(_error("machineStopped", "FATAL", "the controller has stopped; a person must start it"))
    elif word is None and body.state is MachineState.OBSTACLE and not body.is_held:
        found.append(_error("machineObstacle", "WARNING", "takes no part: another contract or site"))
    for segment, message in machines.blocked.items():
        references = [{"referenceKey": "nodeId", "referenceValue": str(segment)}]
        reason = message.reason.name
        found.append(
            _error("blocked", "WARNING", f"{segment} cannot be passed: {reason}") | {"errorReferences": references}
        )
    task = body.task
    if task is not None and task.phase in (TaskPhase.REFUSED, TaskPhase.FORFEITED):
        references = [{"referenceKey": "orderId", "referenceValue": reference_text(task.task)}]
        what = f"the task was given up: {task.reason.name}"
        found.append(_error("orderFailed", "WARNING", what) | {"errorReferences": references})
    return found


def _halted(machines: Machines, word: Halted) -> Json:
    """A machine that does not act: FATAL where a person is needed, and what to do; else it goes on by itself."""
    name = machines.site.machines[word.machine].name
    stands = f"{name} stands: {reason_words(word.reason)}"
    if not word.needs_person:
        return _error("machineHalted", "WARNING", f"{stands}; it goes on by itself")
    hint = {"errorHint": remedy(machines.site, word.reason, name)}
    return _error("machineHalted", "FATAL", f"{stands}; it needs a person") | hint


def _error(kind: str, level: str, description: str) -> Json:
    return {"errorType": kind, "errorLevel": level, "errorDescription": description}


def _information(machines: Machines, body: MobileMachine, now_us: int) -> list[Json]:
    told_us, wait = body.wait or (0, None)
    if wait is None or now_us - told_us > WAIT_TOLD_US:
        return []
    segment = Segment(wait.track, wait.index)
    references = [
        {"referenceKey": "nodeId", "referenceValue": str(segment)},
        {"referenceKey": "reason", "referenceValue": wait.reason.name},
    ]
    blocker = machines.site.machines.get(wait.blocker)
    if blocker is not None:
        references.append({"referenceKey": "serialNumber", "referenceValue": blocker.name})
    return [{"infoType": "waiting", "infoLevel": "INFO", "infoReferences": references}]
