import pytest

from bus_sim.can.faults import FaultKind, InjectedFault, parse_fault
from tests.can.conftest import MakeRig
from tests.can.rig import Rig, ext, std


def burst(rig: Rig, count: int = 20) -> None:
    """One sender, three receivers with node-IDs 2, 3, 4; frames numbered in their data."""
    a = rig.node("a", 1)
    for node_id, name in ((2, "b"), (3, "c"), (4, "d")):
        rig.node(name, node_id)
    for number in range(count):
        a.send(ext(0x100, bytes((number,))))
    rig.run(count * 400 + 10_000)


def numbers(rig: Rig, name: str) -> list[int]:
    return [frame.data[0] for _time, frame in rig.heard[name]]


def test_omission_at_chosen_receivers_goes_unnoticed(make_rig: MakeRig) -> None:
    rig = make_rig(faults=[parse_fault("omission:receivers=3|d,nth=5")])
    burst(rig)
    assert numbers(rig, "b") == list(range(20))
    assert numbers(rig, "c") == numbers(rig, "d") == [number for number in range(20) if number != 4]
    assert rig.errors() == []
    assert len(rig.confirmed["a"]) == 20
    assert rig.medium.injectors[0].struck == 2


def test_omission_with_a_probability_draws_for_each_receiver(make_rig: MakeRig) -> None:
    def heard(seed: int) -> tuple[list[int], list[int], list[int]]:
        rig = make_rig(faults=[parse_fault(f"omission:probability=0.5,seed={seed}")])
        burst(rig, 40)
        return numbers(rig, "b"), numbers(rig, "c"), numbers(rig, "d")

    first, again, other = heard(7), heard(7), heard(8)
    assert first == again
    assert first != other
    assert len({tuple(each) for each in first}) == 3
    assert all(8 < len(each) < 32 for each in first)


def test_duplicate(make_rig: MakeRig) -> None:
    rig = make_rig(
        faults=[parse_fault("duplicate:receivers=c,nth=2"), parse_fault("duplicate:receivers=d,delay_us=5000,nth=1")]
    )
    burst(rig, 4)
    assert numbers(rig, "b") == [0, 1, 2, 3]
    assert numbers(rig, "c") == [0, 1, 1, 2, 3]
    assert numbers(rig, "d") == [0, 1, 2, 3, 0]
    assert len(rig.frames()) == 4


def test_delay_reorders_at_one_receiver_only(make_rig: MakeRig) -> None:
    rig = make_rig(faults=[parse_fault("delay:receivers=2,delay_us=1000,nth=1")])
    burst(rig, 6)
    on_time = rig.heard["c"][0]
    late = next(heard for heard in rig.heard["b"] if heard[1].data == b"\x00")
    assert late[0] == on_time[0] + 1_000
    assert numbers(rig, "b")[0] != 0
    assert sorted(numbers(rig, "b")) == numbers(rig, "c") == [0, 1, 2, 3, 4, 5]


def test_corruption_is_seen_by_all_and_costs_bus_time_only(make_rig: MakeRig) -> None:
    rig = make_rig(faults=[parse_fault("corruption:probability=0.3,seed=3")])
    burst(rig)
    assert len(rig.errors()) > 3
    for name in "bcd":
        assert numbers(rig, name) == list(range(20))


def test_a_fault_takes_only_what_it_names(make_rig: MakeRig) -> None:
    rig = make_rig(faults=[parse_fault("omission:id=0x100:0x7F0,format=extended,from_us=2000,until_us=4000")])
    a = rig.node("a")
    rig.node("b")
    struck = ext(0x10F)
    for when_us, frame in ((0, struck), (2_500, ext(0x110)), (2_500, struck), (2_500, std(0x100)), (4_000, struck)):
        rig.at(when_us, a, frame)
    rig.run(10_000)
    assert [frame for _time, frame in rig.heard["b"]] == [struck, ext(0x110), std(0x100), struck]


def test_each_fault_has_a_stream_of_its_own(make_rig: MakeRig) -> None:
    def omitted(*lines: str) -> list[int]:
        rig = make_rig(faults=[parse_fault(line) for line in lines])
        burst(rig, 40)
        return [number for number in range(40) if number not in numbers(rig, "c")]

    alone = omitted("omission:receivers=c,probability=0.2,seed=5")
    in_company = omitted("omission:receivers=b,probability=0.7,seed=1", "omission:receivers=c,probability=0.2,seed=5")
    assert alone == in_company != []


@pytest.mark.parametrize(
    "line",
    [
        "omission",
        "omission:name=wet plug,receivers=3|MR2,probability=0.01,seed=7,id=0x100:0x7F0",
        "duplicate:delay_us=200,nth=3",
        "delay:delay_us=1500,format=standard,from_us=10,until_us=20",
        "corruption:receivers=4,format=extended",
    ],
)
def test_a_fault_reads_what_it_writes(line: str) -> None:
    fault = parse_fault(line)
    assert parse_fault(str(fault)) == fault


def test_the_line_means_what_it_says() -> None:
    fault = parse_fault("omission:receivers=3|4,probability=0.01,id=0x18FF0005,seed=7")
    assert fault == InjectedFault(
        FaultKind.OMISSION,
        receivers=("3", "4"),
        probability=0.01,
        id_value=0x18FF0005,
        id_mask=0x1FFFFFFF,
        seed=7,
    )


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("", "no kind of fault; known are omission, duplicate, delay, corruption"),
        ("omision:nth=1", "'omision' is no kind of fault"),
        ("omission:nth", "'nth' is no setting"),
        ("omission:probabilty=1", "'probabilty=1' is no setting; known are id, name"),
        ("omission:probability=often", "probability=often: must be a number from 0 to 1"),
        ("omission:probability=1.5", "must be 0 to 1"),
        ("omission:probability=nan", "must be 0 to 1"),
        ("omission:nth=0", "counted from 1"),
        ("omission:nth=2,probability=0.5", "exclude each other"),
        ("omission:nth=1,nth=2", "nth is given twice"),
        ("omission:id=1,id=2", "id is given twice"),
        ("omission:id=0x20000000", "id=0x20000000: must be VALUE or VALUE:MASK"),
        ("omission:id=zz", "id=zz: must be"),
        ("omission:receivers=3||4", "receivers=3||4: must be node-IDs or names"),
        ("omission:format=fd", "format=fd: must be standard, extended or any"),
        ("omission:from_us=5,until_us=5", "not be empty"),
        ("omission:delay_us=5", "an omission has no delay"),
        ("delay", "delay_us is missing"),
        ("duplicate:delay_us=-1", "must not be negative"),
    ],
)
def test_a_bad_line_says_what_is_wrong_in_one_line(line: str, said: str) -> None:
    with pytest.raises(ValueError, match="fault") as error:
        parse_fault(line)
    assert said in str(error.value)
    assert "\n" not in str(error.value)
