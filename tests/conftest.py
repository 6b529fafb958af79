"""How the random examples are drawn: the same ones every time, unless `make fuzz` asks for new ones."""

from hypothesis import HealthCheck, settings

slow = [HealthCheck.too_slow, HealthCheck.data_too_large]
settings.register_profile("default", deadline=None, derandomize=True, suppress_health_check=slow)
settings.register_profile("fuzz", deadline=None, max_examples=500, print_blob=True, suppress_health_check=slow)
settings.load_profile("default")
