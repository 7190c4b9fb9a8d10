# %% [markdown]
# # A campaign
#
# Two hundred runs of a scenario, over tolerances of a valve and its supply: how good is the resistance that `Semera` finds?

# %%
from pathlib import Path

import gapsense

STUDY = """
title = "Tolerances of valve and supply"
scenario = "semera_valve"

[sample]
method = "latin-hypercube"
count = 200
seed = 1

[[sample.factors]]
parameter = "valve.coil.resistance"
distribution = "normal"
mean = 76.4
std = 1.5

[[sample.factors]]
parameter = "sensor.noise.current"
distribution = "loguniform"
low = 2e-4
high = 5e-3
"""
Path("tolerances.toml").write_text(STUDY)
result = gapsense.campaign("tolerances.toml")
print(result)

# %% [markdown]
# Quantiles of each metric: 5 %, median, 95 %.

# %%
for name, (low, median, high) in result.quantiles().items():
    if name.startswith("semera_resistance"):
        print(f"{name:26} {low:.3f} {median:.3f} {high:.3f} {result.units[name]}")

# %% [markdown]
# The same command continues a campaign that was interrupted; what is done is not computed again. Each metric over each parameter:

# %%
from gapsense.report.campaigns import figure

figure(result, ["semera_resistance_first", "semera_resistance_after"])
