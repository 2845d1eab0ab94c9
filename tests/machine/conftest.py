"""How long all searches go on.

That is a while on a desk, and thoroughly where CI or BT_THOROUGH is set.
"""

from __future__ import annotations

import os

from hypothesis import HealthCheck, settings

THOROUGH = bool(os.environ.get("CI") or os.environ.get("BT_THOROUGH"))

settings.register_profile(
    "machine-ci",
    max_examples=2_000,
    stateful_step_count=60,
    deadline=None,
    print_blob=True,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)
settings.register_profile("machine", settings.get_profile("machine-ci"), max_examples=150)
