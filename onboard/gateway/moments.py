"""Times in orders: of any zone, or of the day at the site."""

from datetime import datetime, time, timedelta, tzinfo
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from onboard.core.site import Site
from onboard.gateway.bus_orders import RefusedError

#: Nobody knows what will be so long from now.
MOST_AHEAD = timedelta(days=7)


def moment_us(text: str, path: str) -> int:
    """Wall time in us since 1970 of ISO 8601 with a time zone. Raises ``RefusedError``."""
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        moment = None
    if moment is None or moment.tzinfo is None:
        raise RefusedError("MALFORMED", "must be ISO 8601 with a time zone, such as 2026-03-01T16:30:00Z", path)
    return round(moment.timestamp() * 1_000_000)


def announced_us(text: str, site: Site, wall_us: int) -> int:
    """When a car will be fetched, us since 1970, by ``HH:MM`` of today at the site, or ISO 8601; ``wall_us`` is now.

    Raises ``RefusedError`` for what is no time, is past, or is more than a week away.
    """
    path = "$.fetch_at"
    try:
        of_day = time.fromisoformat(text) if len(text) == len("17:30") else None
    except ValueError as error:
        raise RefusedError("MALFORMED", f"{text} is no time of day; write one from 00:00 to 23:59", path) from error
    if of_day is None:
        found_us = moment_us(text, path)
    else:
        now = datetime.fromtimestamp(wall_us / 1e6, _zone(site)).astimezone(_zone(site))
        at = now.replace(hour=of_day.hour, minute=of_day.minute, second=0, microsecond=0)
        found_us = round(at.timestamp() * 1_000_000)
    if found_us <= wall_us:
        raise RefusedError("TOO_LATE", "is past", path)
    if found_us > wall_us + MOST_AHEAD // timedelta(microseconds=1):
        raise RefusedError("TOO_LATE", f"is more than {MOST_AHEAD.days} days away", path)
    return found_us


def _zone(site: Site) -> tzinfo | None:
    """The site's, else None for this computer's."""
    if not site.time_zone:
        return None
    try:
        return ZoneInfo(site.time_zone)
    except (ZoneInfoNotFoundError, ValueError) as error:
        what = f"this computer knows no time zone {site.time_zone}; write the time with its zone"
        raise RefusedError("UNSUPPORTED", what, "$.fetch_at") from error
