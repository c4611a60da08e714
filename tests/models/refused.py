"""Recorded steps against the models: the first step of each token and call that its model does not have."""

from pathlib import Path

from onboard.contract.codes import TokenKind
from onboard.core.authority import TokenKey
from tests.models.recorder import Call, Recorder
from tests.models.spin import NEGOTIATION, TOKEN, first_refused


def refused_tokens(folder: Path, recorder: Recorder, most: int | None = None) -> dict[TokenKey, str]:
    """Of the first ``most`` tokens that moved, or of all."""
    refused = {}
    for key, steps in list(recorder.tokens.items())[:most]:
        begin = "holds[0] = true; kept_holds[0] = true"
        if key.kind is TokenKind.CAR:
            # A car's token begins with version 1, all others without one.
            begin += "; seen[0] = 1; kept_seen[0] = 1; stated[AT(1, 0)] = true"
        sizes = (f"NODES={len(recorder.nodes[key])}", "VERSIONS=80", f"CRASHES={recorder.crashes[key]}")
        step = first_refused(folder, TOKEN, steps, begin, *sizes)
        if step is not None:
            refused[key] = step
    return refused


def refused_calls(folder: Path, recorder: Recorder) -> dict[Call, str]:
    """Of all calls for whole tasks."""
    refused = {}
    for call, steps in recorder.calls.items():
        nodes, costs = recorder.bidders.get(call, [0]), recorder.costs.get(call, {})
        # Lower cost, then lower node-ID; who did not bid comes last.
        order = sorted(range(len(nodes)), key=lambda i: (i not in costs, costs.get(i, 0), nodes[i]))
        begin = "; ".join(["begin()", *(f"rank[{i}] = {place}" for place, i in enumerate(order))])
        step = first_refused(folder, NEGOTIATION, steps, begin, f"MACHINES={len(nodes)}", "LOSSES=200")
        if step is not None:
            refused[call] = step
    return refused
