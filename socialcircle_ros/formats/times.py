# SPDX-License-Identifier: Apache-2.0
"""When a surface was measured, where its file states it."""

import re
from collections.abc import Mapping
from datetime import datetime, timedelta, timezone

_DATE = re.compile(r'(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d:\d\d)(?:[.,]\d+)?\s*(Z|[+-]\d\d:?\d\d)?', re.ASCII)
_STAMP = re.compile(r'(\d{1,11})\.(\d{9})', re.ASCII)
_EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)
_SDF = '%d%m%Y%H%M'


def stated_time(metadata: Mapping[str, str]) -> int | None:
    """The time that the metadata of a file state, ns since 1970; a date without a zone is taken as UTC.

    Args:
        metadata: `stamp` is the time of a cloud, as `export` writes it, in s; `date` is a date in ISO 8601.

    Returns:
        The time; None: it is not stated, or no such date.
    """
    stamp = _STAMP.fullmatch(metadata.get('stamp', ''))
    if stamp:
        return int(stamp[1]) * 1_000_000_000 + int(stamp[2])
    date = _DATE.fullmatch(metadata.get('date', '').strip())
    if not date:
        return None
    zone = (date[3] or 'Z').replace('Z', '+0000').replace(':', '')
    try:
        moment = datetime.strptime(f'{date[1]} {date[2]} {zone}', '%Y-%m-%d %H:%M:%S %z')
    except ValueError:
        return None
    return (moment - _EPOCH) // timedelta(seconds=1) * 1_000_000_000


def date_of_sdf(text: str) -> dict[str, str]:
    """The date of an SDF header (ISO 25178-71), DDMMYYYYHHMM, as metadata; nothing where it is none."""
    try:
        return {'date': datetime.strptime(text.strip('\0 '), _SDF).isoformat()}  # noqa: DTZ007 - it has no zone
    except ValueError:
        return {}
