"""One name, one class: top-level classes of the product that share a name stay few."""

import ast
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[2]
PRODUCT = ("onboard", "bus_sim", "hil", "deploy")
#: Of the names, and of the classes: pycyphal and labgrid, which are held up as examples, have this share.
MOST_PERCENT = 3


def class_names(texts: Iterable[str]) -> Counter[str]:
    """Names of top-level classes, and in how many texts each is defined."""
    return Counter(node.name for text in texts for node in ast.parse(text).body if isinstance(node, ast.ClassDef))


def homonyms(names: Counter[str]) -> list[str]:
    """Names of more than one class, in the order of the alphabet."""
    return sorted(name for name, times in names.items() if times > 1)


def test_few_names_stand_for_more_than_one_class() -> None:
    files = [path for folder in PRODUCT for path in sorted((ROOT / folder).rglob("*.py"))]
    names = class_names(path.read_text(encoding="utf-8") for path in files)
    assert len(names) > 1000, "the walk finds the product"
    shared = homonyms(names)
    classes = sum(names[name] for name in shared)
    assert 100 * len(shared) <= MOST_PERCENT * len(names), shared
    assert 100 * classes <= MOST_PERCENT * names.total(), f"{classes} of {names.total()} classes: {shared}"


def test_a_name_of_two_modules_is_found_and_a_class_within_a_class_is_none() -> None:
    one, two = "class Order: ...\nclass Bid:\n    class Entry: ...\n", "class Order: ...\nclass Entry: ...\n"
    assert homonyms(class_names([one, two])) == ["Order"]
