# SPDX-License-Identifier: Apache-2.0
"""Settings as a row holds them: the parameters that differ from their defaults, and a hash."""

import json
from dataclasses import dataclass
from hashlib import blake2b

from socialcircle_ros.settings import PARAMETERS, OutputSettings, PipelineSettings

_HASH_BYTES = 8
# Neither what is published nor what a node does besides has an effect on the numbers of a cloud.
_WITH_EFFECT = PipelineSettings().to_ros().keys() - OutputSettings().to_ros().keys()


@dataclass(frozen=True)
class SettingsText:
    """The settings in force, as text.

    Attributes:
        text: JSON of the parameters with other values than their defaults, by their full names in their order.
        digest: 16 hexadecimal digits of all parameters with an effect on the numbers of a cloud, and of the
            lesson.
    """

    text: str
    digest: str

    @classmethod
    def of(cls, settings: PipelineSettings) -> 'SettingsText':
        """Describe settings."""
        values = {name: value for name, value in settings.to_ros().items() if name in _WITH_EFFECT}
        changed = {name: value for name, value in values.items() if value != PARAMETERS[name].default}
        lesson = settings.circle.taught
        hashed = [*sorted(values.items()), *([lesson.digest] if lesson is not None else [])]
        digest = blake2b(json.dumps(hashed).encode(), digest_size=_HASH_BYTES).hexdigest()
        return cls(json.dumps(changed, ensure_ascii=False), digest)
