"""Every call of a log in words: who called, who bid what and when, who won, what was promised and when it came true."""

from onboard.contract.codes import Operation, Reason
from onboard.contract.messages import Reference
from onboard.history.calls import CallHistory, is_task
from onboard.trace.words import Words


def call_lines(call: CallHistory, words: Words, start_us: int) -> list[str]:
    """The lines of one call; times since the log's start, promises beside what came true."""
    terms = call.terms
    names = words.system
    way = names.way(terms)
    parent = "" if not terms.depth else f", part {terms.part} of call {words.reference(Reference(*terms.parent))}"
    again = f", attempt {terms.attempt}" if terms.attempt > 1 else ""
    lines = [
        f"{_at(call.opened_us, start_us)} {words.machine(terms.sender)} call {terms.call}: "
        f"{names.operation(terms.operation)} {names.thing(terms.car)}, task {words.reference(terms.task)}"
        f"{way and f', {way}'}{parent}{again}; {call.messages} messages"
    ]
    for time_us, node, cost in call.bids:
        lines.append(
            f"    {_at(time_us, start_us)} {words.machine(node)} bids {words.cost(cost, terms.criterion)}"
            f" ({(time_us - call.opened_us) / 1000:.1f} ms after the call)"
        )
    lines.append(f"    {_ending(call, words, start_us)}")
    lines += [f"    {_at(time_us, start_us)} {words.machine(node)} started anew" for time_us, node in call.restarts]
    return lines


def _ending(call: CallHistory, words: Words, start_us: int) -> str:
    if call.result is None or call.closed_us is None:
        return "still open at the end of the log"
    reason = f": {words.system.reason(call.reason)}" if call.reason is not Reason.NONE else ""
    text = f"{_at(call.closed_us, start_us)} {call.result.name.lower()}{reason}"
    if not call.winner:
        return text
    text += f" to {words.machine(call.winner)}"
    if call.awards > 1:
        text += f" (said {call.awards} times)"
    if call.promised_us is not None:
        text += f"; promised {_at(call.promised_us, start_us)}"
    if call.finished_us is None:
        return text + (
            "; finish not in this log" if is_task(call.terms) or call.terms.operation is Operation.RIDE else ""
        )
    text += f", finished {_at(call.finished_us, start_us)}"
    if call.promised_us is not None:
        text += f" ({(call.finished_us - call.promised_us) / 1e6:+.3f} s)"
    return text


def _at(time_us: int, start_us: int) -> str:
    return f"{(time_us - start_us) / 1e6:.3f} s"
