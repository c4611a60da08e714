"""What a polishing shop calls things."""

from onboard.contract.messages import CallForProposals, Reference
from onboard.systems.words import SiteWords


class ShopWords(SiteWords):
    """What the shop's messages mean."""

    noun = "part"

    def way(self, call: CallForProposals) -> str:
        """What is polished goes nowhere."""
        return ""

    def place(self, number: int) -> str:
        """There is one place."""
        return "the shop"

    def done(self, load: Reference, station: int) -> str:
        """A part that is done."""
        return f"has polished {self.thing(load)}"


WORDS = ShopWords
