"""Settings as a row holds them: the parameters that differ from their defaults, and a hash."""

import json
from dataclasses import dataclass
from hashlib import blake2b

from socialcircle_ros.settings import PARAMETERS, OutputSettings, PipelineSettings

_HASH_BYTES = 8
_NO_EFFECT = tuple(row.name for row in OutputSettings.parameters())


@dataclass(frozen=True)
class SettingsText:
    """The settings in force, as text.

    Attributes:
        text: JSON of the parameters with other values than their defaults, by their full names in their order.
        digest: 16 hexadecimal digits of all parameters with an effect on numbers; those of `output` have none.
    """

    text: str
    digest: str

    @classmethod
    def of(cls, settings: PipelineSettings) -> 'SettingsText':
        """Describe settings."""
        values = {name: value for name, value in settings.to_ros().items() if name not in _NO_EFFECT}
        changed = {name: value for name, value in values.items() if value != PARAMETERS[name].default}
        digest = blake2b(json.dumps(sorted(values.items())).encode(), digest_size=_HASH_BYTES).hexdigest()
        return cls(json.dumps(changed, ensure_ascii=False), digest)
