"""Times of many frames at once, as candump prints them."""

import numpy as np
import numpy.typing as npt

#: `` (SSSSSSSSSS.UUUUUU) ``: where its digits stand, and the power of ten that each counts.
_FORM = b" (0000000000.000000) "
_PLACES = np.array([at for at, sign in enumerate(_FORM) if sign == ord("0")])
_TENS = 10 ** np.arange(len(_PLACES) - 1, -1, -1, dtype=np.int64)


def stamps(time_us: npt.NDArray[np.int64]) -> list[str] | None:
    """Absolute times in brackets, a space before and behind; None where one has more than ten digits of seconds."""
    if len(time_us) and not 0 <= int(np.min(time_us)) <= int(np.max(time_us)) < 10 * _TENS[0]:
        return None
    text = np.empty((len(time_us), len(_FORM)), np.uint8)
    text[:] = np.frombuffer(_FORM, np.uint8)
    text[:, _PLACES] += (time_us[:, None] // _TENS % 10).astype(np.uint8)
    signs = text.tobytes().decode("ascii")
    return [signs[at : at + len(_FORM)] for at in range(0, len(signs), len(_FORM))]
