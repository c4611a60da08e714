"""Under which version a token goes on: segments in line that go together can be told as one run under one version."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from onboard.contract.codes import TokenKind
from onboard.contract.constants import MAX_VERSION, NOBODY
from onboard.contract.runs import MOST_OF_RUN, MOST_SPREAD
from onboard.core.token_keys import TokenKey


@dataclass
class RunVersions:
    """Versions of one giver; ``held`` tells under which it holds a token, None where it does not."""

    held: Callable[[TokenKey], int | None]
    #: When, to whom, of which number and under which version a segment was given last.
    _last: tuple[int, int, int, int] = (0, NOBODY, 0, 0)

    def following(self, key: TokenKey, own: int, to: int, now_us: int) -> int:
        """Newer than its ``own``; of a segment newer than all in line, or that of the run it goes on (rule 4).

        Raises ``ValueError`` where no version is left.
        """
        version = own + 1
        if key.kind is TokenKind.SEGMENT:
            at_us, node, number, given = self._last
            is_beside = number >> 8 == key.number >> 8 and abs(number - key.number) == 1
            if (at_us, node) == (now_us, to) and is_beside and own < given <= own + MOST_SPREAD:
                version = given
            else:
                version = 1 + max([own, *(one for one in self._in_line(key) if one - own < MOST_SPREAD)])
            self._last = now_us, to, key.number, version
        if version > MAX_VERSION:
            raise ValueError(f"{key} has no version left after {MAX_VERSION}: regenerate the tokens of this site")
        return version

    def _in_line(self, key: TokenKey) -> Iterator[int]:
        """Versions of the segments that it holds in line with one, as far as a run goes to either side."""
        for step in (1, -1):
            for number in range(key.number + step, key.number + step * MOST_OF_RUN, step):
                version = self.held(TokenKey(key.kind, number)) if number >> 8 == key.number >> 8 else None
                if version is None:
                    break
                yield version
