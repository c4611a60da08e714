"""Points in time as tables of others write them: any format, with or without an offset, in a zone whose clock jumps."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from bus_sim.demand import DemandError

#: Words for formats that ``strptime`` does not have: whole or decimal seconds, and milliseconds, since 1970 in UTC.
EPOCH, EPOCH_MS = "epoch", "epoch_ms"
_PER_SECOND = {EPOCH: 1.0, EPOCH_MS: 1000.0}
#: Years of demand: what is outside is a mistake in the format, such as milliseconds read as seconds.
YEARS = range(1970, 2200)
#: Spreadsheets count days from 1900 (1904 on some): as seconds or milliseconds they would be a minute to a day of 1970.
_DAY_NUMBERS = range(15_000, 100_000)
#: The year of a format that says none.
_NO_YEAR = 1900
#: Directives that say one. A day without a year Python 3.13 reads with a warning, and 3.15 may not.
_OF_YEAR = ("%Y", "%y", "%G", "%c", "%x")
#: The longest text of ISO 8601 that is a day without a time.
_DAY_LENGTH = len("2019-07-24")


class CellError(ValueError):
    """What is wrong with one value, and its remedy, in words that follow the value."""


def checked_format(text: str) -> str:
    """A format as it is, or one of our words. Raises ``DemandError`` for one that ``strptime`` does not have."""
    if text not in _PER_SECOND:
        try:
            _strptime(datetime(2000, 2, 2, tzinfo=UTC).strftime(text), text)
        except ValueError as error:
            what = str(error).partition(" in format")[0]
            raise DemandError(
                f"--date-format {text}: {what}; such as '%d.%m.%Y %H:%M', {EPOCH} or {EPOCH_MS}"
            ) from error
    return text


def zone_named(name: str) -> ZoneInfo:
    """A zone by its IANA name. Raises ``DemandError`` for a name that the zone database here does not have."""
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError) as error:
        raise DemandError(f"--zone {name}: no such zone; write its IANA name, such as Europe/Paris") from error


@dataclass(frozen=True)
class MomentForm:
    """How points in time are written.

    ``formats`` are tried in their order: those of ``strptime``, ``epoch`` or ``epoch_ms``; without any, ISO 8601.
    ``zone`` is that of times without an offset; those that have one are shown in it.
    """

    formats: tuple[str, ...] = ()
    zone: ZoneInfo | None = None

    def read(self, text: str) -> tuple[datetime, ...]:
        """The point in time, with the offset that its clock had then.

        Two of them, the earlier first, where the clock showed the time twice. Raises ``CellError`` for a text that is
        none, a time without offset where there is no zone, and one that the clock left out.
        """
        moment = self._parsed(text)
        if moment.year == _NO_YEAR and moment.tzinfo is None:
            raise CellError("has no year; join the column of the day to that of the time: --columns NAME=DAY+TIME")
        if moment.year not in YEARS:
            raise CellError(f"is in the year {moment.year}; write one from {YEARS[0]} to {YEARS[-1]}")
        if moment.tzinfo is not None:
            return (_fixed(moment if self.zone is None else moment.astimezone(self.zone)),)
        if self.zone is None:
            raise CellError("has no UTC offset; write it as 2019-07-24 05:35:06-07:00, or name the zone: --zone NAME")
        return _clocked(moment, self.zone)

    def _parsed(self, text: str) -> datetime:
        try:
            if not self.formats and not text.isdecimal() and len(text) > _DAY_LENGTH:
                return datetime.fromisoformat(text)
        except ValueError:
            pass
        found = (moment for moment in (_by_format(text, form) for form in self.formats) if moment is not None)
        moment = next(found, None)
        if moment is not None:
            return moment
        if _is_day_number(text):
            raise CellError("is a spreadsheet's number of a day; give its column a format of dates there and save anew")
        if self.formats:
            raise CellError(f"is not written as {' or '.join(self.formats)}; correct it, or add its --date-format")
        if text.isdecimal():
            remedy = f"seconds or milliseconds since 1970 are --date-format {EPOCH} or {EPOCH_MS}"
        else:
            remedy = "write it as 2019-07-24 05:35:06-07:00, or say how it is written: --date-format FORMAT"
        raise CellError(f"is no date and time; {remedy}")


def _is_day_number(text: str) -> bool:
    """Whether it is a whole or decimal number, with point or comma, of some day of the years from 1941 to 2173."""
    whole = text.replace(",", ".").partition(".")[0]
    return whole.isdecimal() and len(whole) == 5 and int(whole) in _DAY_NUMBERS and text[5:6] in ("", ".", ",")


def _by_format(text: str, form: str) -> datetime | None:
    """None where the text is not of this format; a number of a day is none of seconds."""
    try:
        if form in _PER_SECOND:
            if _is_day_number(text):
                return None
            return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=float(text) / _PER_SECOND[form])
        return _strptime(text, form)
    except (ValueError, OverflowError):
        return None


def _strptime(text: str, form: str) -> datetime:
    """In ``_NO_YEAR`` where the format says none. Raises ``ValueError``."""
    if not any(directive in form for directive in _OF_YEAR):
        text, form = f"{_NO_YEAR} {text}", f"%Y {form}"
    return datetime.strptime(text, form)  # noqa: DTZ007  # a format may have an offset or none: the caller looks


def _clocked(moment: datetime, zone: ZoneInfo) -> tuple[datetime, ...]:
    """A time by the clock of a zone (PEP 495: ``fold`` tells the second of two that look alike)."""
    both = [moment.replace(tzinfo=zone, fold=fold) for fold in (0, 1)]
    there = [one for one in both if one.astimezone(UTC).astimezone(zone).replace(tzinfo=None, fold=0) == moment]
    if not there:
        raise CellError(f"was left out by the clock of {zone}; write the time that the clock showed, or its UTC offset")
    readings = [_fixed(one) for one in there]
    return tuple(readings) if len(readings) > 1 and readings[0] != readings[1] else (readings[0],)


def _fixed(moment: datetime) -> datetime:
    """The same with its offset alone: two times of one ``ZoneInfo`` would be subtracted by their clocks."""
    return moment.replace(tzinfo=timezone(moment.utcoffset() or timedelta()), fold=0)
