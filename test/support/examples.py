"""How many examples hypothesis tries: by default always the same few, so that a run is short and repeatable.

To look at a hundred times as many, and at others each time: `pytest --hypothesis-profile=thorough test/…`
"""

from hypothesis import HealthCheck, settings

settings.register_profile(
    "repeatable",
    derandomize=True,
    deadline=None,  # the first example of a process waits for compiled code
    database=None,
    max_examples=100,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
settings.register_profile("thorough", settings.get_profile("repeatable"), derandomize=False, max_examples=10_000)
settings.load_profile("repeatable")


def examples(count: int) -> settings:
    """Return the settings of a test that tries this many examples, or the profile's multiple of that."""
    return settings(max_examples=count * settings().max_examples // 100)
