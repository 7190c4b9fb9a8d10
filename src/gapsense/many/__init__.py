"""Many runs of a scenario: sweeps and campaigns, which are one engine with one plan and one store.

>>> from gapsense import campaign, sweep
>>> swept = sweep("scenarios/semera_valve", seeds=100)  # doctest: +SKIP
>>> result = campaign("tolerances.toml")  # doctest: +SKIP
>>> result.quantiles()["current_noise"]  # doctest: +SKIP
"""
