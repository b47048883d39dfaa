# SPDX-License-Identifier: Apache-2.0
"""Cell and part of a recording, from a pattern on its name."""

import re
from dataclasses import dataclass, field

from socialcircle_ros.errors import SettingError

_FIELDS = {'{cell}': '(?P<cell>[^/]+?)', '{part}': '(?P<part>[^/]+?)', '*': '[^/]*'}


@dataclass(frozen=True)
class NamePattern:
    """A pattern such as `{cell}/{part}_*.mcap`, which the end of a path matches.

    `{cell}` and `{part}` stand for at least one character, `*` for any number; none of them stands for a slash.

    Args:
        text: the pattern; empty: no name matches.

    Raises:
        SettingError: the pattern is no text, names neither, or has one of them twice.
    """

    text: str = ''
    _compiled: re.Pattern[str] | None = field(init=False, default=None, compare=False)

    def __post_init__(self) -> None:
        """Translate the pattern into a regular expression."""
        if not isinstance(self.text, str):
            raise SettingError(f'The pattern of the names must be a text, not {self.text!r}.')
        if not self.text:
            return
        counts = [self.text.count(name) for name in ('{cell}', '{part}')]
        if not any(counts) or max(counts) > 1:
            raise SettingError(
                f'The pattern {self.text!r} must have {{cell}} or {{part}} once, such as {{cell}}/{{part}}_*.mcap.'
            )
        parts = re.split(r'(\{cell\}|\{part\}|\*)', self.text)
        expression = ''.join(_FIELDS.get(part, re.escape(part)) for part in parts)
        object.__setattr__(self, '_compiled', re.compile(f'(?:.*/)?{expression}', re.DOTALL))

    def read(self, path: str) -> tuple[str | None, str | None]:
        """Cell and part that the name of a recording says; None: it does not say it.

        Example:
            >>> NamePattern('{cell}/{part}_*.mcap').read('nights/cell1/lid_007.mcap')
            ('cell1', 'lid')
        """
        found = self._compiled.fullmatch(path) if self._compiled is not None else None
        if found is None:
            return None, None
        groups = found.groupdict()
        return groups.get('cell'), groups.get('part')
