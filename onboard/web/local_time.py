"""The time of day at a site, for people: by the zone of its site file, else that of the computer that shows it."""

from datetime import datetime, tzinfo
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from onboard.core.site import Site
from onboard.web.address import WebError

#: A log whose times are below this, s since the epoch, tells the time from its beginning and no date: two days.
EARLIEST_S = 2 * 86_400


def zone_of(site: Site) -> tzinfo | None:
    """The site's zone, None for this computer's. Raises ``WebError`` for one that this computer does not know."""
    if not site.time_zone:
        return None
    try:
        return ZoneInfo(site.time_zone)
    except (ZoneInfoNotFoundError, ValueError) as error:
        what = "this computer knows no such time zone; correct it, or apt install tzdata"
        raise WebError(f'site {site.name}: time_zone = "{site.time_zone}": {what}') from error


def offset_s(zone: tzinfo | None, time_us: int) -> int:
    """What local time has more than UTC at a moment, in us since the epoch; 0 for a log without a date."""
    if time_us < EARLIEST_S * 1_000_000:
        return 0
    moment = datetime.fromtimestamp(time_us / 1e6, zone).astimezone(zone)
    offset = moment.utcoffset()
    return round(offset.total_seconds()) if offset is not None else 0
