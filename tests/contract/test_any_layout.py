"""Whatever a DBC's author makes of eight bytes, the generated functions are cantools' to the bit: layouts by chance."""

import random
import struct
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from onboard.contract.base import OutOfRangeError, refusal
from onboard.contract.generate import decoding, encoding
from onboard.contract.generate.model import DbcMessage, read_contract
from tests.wire.samples import judge_of, random_value

LAYOUTS = 150
VALUES = 12
#: A frame's bits.
BITS = 64
FRAME = 2147549184
HEAD = f'VERSION "2"\n\nNS_ :\n\nBS_:\n\nBU_: Node\n\nBO_ {FRAME} Drawn: 8 Node\n'
TAIL = 'BA_DEF_  "ContractVersion" INT 1 255;\nBA_DEF_DEF_  "ContractVersion" 1;\nBA_ "ContractVersion" 1;\n'


def drawn(chance: random.Random) -> str:
    """A DBC of one message: signals of 1 to 40 bits with gaps between, some signed, scaled, or short of their bits."""
    lines: list[str] = []
    words: list[str] = []
    at = chance.choice((0, 0, 0, chance.randrange(12)))
    most_signals = chance.randint(3, 8)
    while at < BITS and len(lines) < most_signals:
        name = f"s{len(lines)}"
        bits = min(chance.choice((1, 1, 3, 5, 8, 8, 12, 16, 16, 20, 24, 32, chance.randint(1, 40))), BITS - at)
        is_signed = bits > 1 and chance.random() < 0.3
        least = -(1 << bits - 1) if is_signed else 0
        most = least + (1 << bits) - 1
        if bits == 1 and chance.random() < 0.7:
            words.append(f'VAL_ {FRAME} {name} 1 "YES" 0 "NO" ;\n')
        elif chance.random() < 0.3:
            least, most = least + (most > least + 1), max(most - chance.randrange(1 + (1 << bits) // 4), least + 1)
        scale, offset = chance.choice(((1, 0), (1, 0), (1, 0), (10, 0), (5, 250), (1, -40))) if bits > 1 else (1, 0)
        sign, range_ = "-" if is_signed else "+", f"[{least * scale + offset}|{most * scale + offset}]"
        lines.append(f' SG_ {name} : {at}|{bits}@1{sign} ({scale},{offset}) {range_} "" Node\n')
        at += bits + chance.choice((0, 0, 0, 1, 3, chance.randrange(16)))
    chance.shuffle(lines)
    return HEAD + "".join(lines) + TAIL + "".join(words)


def functions(frame: DbcMessage) -> tuple[Callable[[object], bytes], Callable[[int, bytes], Any]]:
    """Both generated functions of a frame."""
    made = "\n".join(f"{name} = {value}" for name, value in {*encoding.tools(frame), decoding.reader(frame)})
    names = [field.name for field in sorted(frame.fields, key=lambda field: bool(field.default))]
    spoken: dict[str, Any] = {
        "struct": struct,
        "OutOfRangeError": OutOfRangeError,
        "refusal": refusal,
        "Drawn": lambda sender, *values: dict(zip(names, values, strict=True)),
    }
    # The annotation of what is returned is a union of the class, which is a function here.
    text = "\n".join(
        ("from __future__ import annotations", made, encoding.pack_function(frame), decoding.unpack_function(frame))
    )
    exec(text, spoken)  # noqa: S102  # what the generator under test has written
    return spoken["pack_drawn"], spoken["unpack_drawn"]


@pytest.mark.parametrize("seed", range(LAYOUTS))
def test_a_drawn_layout_is_written_and_read_as_by_cantools(seed: int) -> None:
    chance = random.Random(seed)
    text = drawn(chance)
    frame = read_contract("drawn", text, "drawn", ()).frames[0]
    judge = judge_of(text).get_message_by_name("Drawn")
    pack, unpack = functions(frame)
    signals = frame.layout.signals
    for _ in range(VALUES):
        values = {signal.name: random_value(signal, chance) for signal in signals}
        data = pack(SimpleNamespace(**values))
        assert data == judge.encode(values) and unpack(7, data) == values, text
        numbers = [signal for signal in signals if not signal.choices]
        if not numbers:
            continue
        one = chance.choice(numbers)
        beyond = chance.choice((one.minimum - 1, one.maximum + 1))
        with pytest.raises(OutOfRangeError, match=rf"Drawn.{one.name} = {beyond}: outside"):
            pack(SimpleNamespace(**{**values, one.name: beyond}))
