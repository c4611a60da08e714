"""Who ordered from afar is known, and a dispatcher fetches only what its role may."""

import json
from pathlib import Path
from typing import Any

import pytest

from bus_sim.sites import find_site
from onboard.config.problems import ConfigError
from onboard.contract.messages import CarAt
from onboard.contract.messages import Reference as Car
from onboard.gateway.dialect import DIALECTS
from onboard.gateway.edge import edge_of
from onboard.gateway.inbox import BURST, Inbox
from onboard.gateway.orders import OrderBook, OrderEffects
from onboard.gateway.roles_file import load_roles
from onboard.ports.broker import Publication
from onboard.ports.journal import Entry
from onboard.systems.car_park.site import car_park
from onboard.trace.view import SiteView

SITE = car_park(find_site("standard"))
DESKS = {SITE.machines[node].name: node for node in SITE.compartments}
ROLES = """
[hotel]
desks = ["IOC1"]
[office]
desks = ["IOC2", "IOC3"]
cars = ["IOC1", "IOC2"]
[all]
"""
TOPIC = "onboard/standard/orders"


class Book:
    """Orders of a gateway of ``standard``, in which a car came in at each desk."""

    def __init__(self, folder: Path, entries: list[Entry] | None = None) -> None:
        view = SiteView(SITE)
        for number, node in enumerate(SITE.compartments):
            view.feed(CarAt(node, Car(node, 1), SITE.places[number].number, 1, 2_700), 0)
        (folder / "roles.toml").write_text(ROLES, encoding="utf-8")
        roles = load_roles(folder / "roles.toml", SITE)
        self.inbox = Inbox(DIALECTS["2.1"], "onboard/standard", "onboard", roles)
        orders = edge_of(SITE).bus_orders(view, lambda _: None)
        self.book = OrderBook(SITE, orders, 251, entries or [], roles)

    def order(self, topic: str, body: dict[str, Any], now_us: int = 0) -> OrderEffects:
        incoming = self.inbox.judge(Publication(topic, json.dumps(body).encode(), 1), now_us)
        assert incoming is not None
        return self.book.take(incoming, 0, now_us)

    def refusal(self, giver: str, **body: str) -> str:
        """Reason and place of a refusal; empty where the order is taken."""
        effects = self.order(f"{TOPIC}/{giver}" if giver else TOPIC, {"id": f"a{len(self.book.book)}", **body})
        return next((f"{one.reason} {one.path}" for one in effects.refused), "")


@pytest.fixture
def book(tmp_path: Path) -> Book:
    return Book(tmp_path)


def car_of(desk: str) -> str:
    return f"{DESKS[desk]}.1"


@pytest.mark.parametrize("giver", ["", "stranger", "hotel2", "HOTEL"])
def test_who_has_no_role_fetches_no_car(book: Book, giver: str) -> None:
    assert book.refusal(giver, car=car_of("IOC1"), to="IOC1") == "NOT_ALLOWED $"
    assert book.book.wake(10_000_000, 0).say[1:] == [], "nothing but a question to all"


def test_a_dispatcher_fetches_only_what_its_role_may(book: Book) -> None:
    allowed = {
        (giver, car, to)
        for giver in ("hotel", "office", "all")
        for car in DESKS
        for to in DESKS
        if not book.refusal(giver, car=car_of(car), to=to)
    }
    assert {one for one in allowed if one[0] == "hotel"} == {("hotel", "IOC1", "IOC1")}
    assert {one for one in allowed if one[0] == "office"} == {
        ("office", car, to) for car in ("IOC1", "IOC2") for to in ("IOC2", "IOC3")
    }
    assert len({one for one in allowed if one[0] == "all"}) == len(DESKS) ** 2
    said = book.book.wake(10_000_000, 0).say[1:]
    assert len(said) == len(allowed), "what is refused is not said on the bus"


def test_a_role_parks_at_its_own_desks(book: Book) -> None:
    assert book.refusal("hotel", **{"from": "IOC2"}) == "NOT_ALLOWED $.from"
    assert book.refusal("hotel", **{"from": "IOC1"}) == ""


def test_the_place_of_a_refusal_tells_what_the_role_has_not(book: Book) -> None:
    assert book.refusal("hotel", car=car_of("IOC1"), to="IOC2") == "NOT_ALLOWED $.to"
    assert book.refusal("hotel", car=car_of("IOC2"), to="IOC1") == "NOT_ALLOWED $.car"


def test_who_ordered_is_on_the_disk_and_another_cannot_ask_after_it(book: Book, tmp_path: Path) -> None:
    order = {"id": "A1", "car": car_of("IOC1"), "to": "IOC1"}
    written = [one.entry() for one in book.order(f"{TOPIC}/hotel", order).changed]
    again = Book(tmp_path, written)
    assert again.book.book["A1"].giver == "hotel"
    assert again.order(f"{TOPIC}/hotel", order).to_tell == [again.book.book["A1"]]
    assert [one.reason for one in again.order(f"{TOPIC}/all", order).refused] == ["NAME_TAKEN"]


def test_one_busy_dispatcher_takes_no_others_turn(book: Book) -> None:
    for number in range(BURST):
        book.order(f"{TOPIC}/hotel", {"id": f"n{number}", "from": "IOC1"})
    reasons = []
    for giver in ("hotel", "office", "stranger"):
        said = Publication(f"{TOPIC}/{giver}", json.dumps({"id": "x", "from": "IOC2"}).encode(), 1)
        found = book.inbox.judge(said, 0)
        assert found is not None
        reasons.append(found.reason)
    assert reasons == ["TOO_FAST", "", ""]


def test_a_mistake_in_the_file_of_roles_is_told_with_line_and_remedy(tmp_path: Path) -> None:
    path = tmp_path / "roles.toml"
    path.write_text('[hotel]\ndesks = ["IOC1", "IOC9"]\ncolour = 1\n["a b"]\n', encoding="utf-8")
    with pytest.raises(ConfigError) as error:
        load_roles(path, SITE)
    lines = str(error.value).replace(str(path), "roles.toml").splitlines()
    assert lines[0].startswith('roles.toml:2: hotel.desks[1] = "IOC9": no machine of standard; one of ')
    assert lines[1].startswith("roles.toml:3: hotel.colour: unknown key")
    assert lines[2].startswith("roles.toml:4:") and "is no level of a topic" in lines[2]
