"""How often the interpreter looks for objects that refer to each other in a ring: whoever works here makes hardly any.

All else goes as soon as nobody refers to it. Each look at the newest objects, and now and then at all, takes time in
which a machine does nothing else.
"""

import contextlib
import gc
from collections.abc import Iterator

#: New objects between two looks, for a run in a simulator: at so many a look takes some milliseconds.
MANY = 50_000
#: The same for a machine: a look at so many takes one millisecond or two where figures are measured.
SOME = 10_000


@contextlib.contextmanager
def rare_looks(new_objects: int, *, settled: bool = False) -> Iterator[None]:
    """Look for rings only each so many new objects (``gc.set_threshold``), never more often than before.

    ``settled``: what is there by now stays, and is not looked at any more (``gc.freeze``).
    """
    if not hasattr(gc, "get_threshold"):
        # PyPy counts no references, and looks in its own way.
        yield
        return
    before = gc.get_threshold()
    is_first = settled and not gc.get_freeze_count()
    gc.set_threshold(max(before[0], new_objects))
    if is_first:
        gc.collect()
        gc.freeze()
    try:
        yield
    finally:
        if is_first:
            gc.unfreeze()
        gc.set_threshold(*before)
