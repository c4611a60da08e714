"""The three answers of a node agent, and the stops of an order (rows G11, G15)."""

import pytest

from onboard.contract.graph import NodeAnswer, NodeVerdict, VisitList
from onboard.systems.graph.fields import five, stops_of
from onboard.wire.codec import codecs
from tests.wire.samples import frames_of


@pytest.mark.parametrize(("word", "byte"), [("GO", 0), ("STOP", 1), ("ANOTHER", 2)])
def test_g15_the_three_answers_are_three_values_of_one_frame(word: str, byte: int) -> None:
    codec = codecs(frames_of("graph")).fleet
    answer = NodeAnswer(1, 11, 4, NodeVerdict[word], 0, 0)
    (frame,) = codec.encode(answer)
    assert frame.data[2] & 0x0F == byte
    assert codec.decode_part(frame) == answer


def test_stops_fill_a_frame_and_no_more() -> None:
    assert stops_of(VisitList(9, 1, 21, *five((4, 0, 6)))) == (4, 0, 6)
    with pytest.raises(ValueError, match="6 stops"):
        five((1, 2, 3, 4, 5, 6))
