# %% [markdown]
# # Soft landing, from cycle to cycle
#
# `RunToRun` lands a valve softly whose parameters are known to 10 % only. The first cycle is an ordinary one; each later one is gentler, by what the last one has taught.
# The scenario `run_to_run` comes with Gapsense.

# %%
import gapsense

result = gapsense.run("run_to_run")
print(result)

# %% [markdown]
# How hard does the armature land? The speed of the last impact is an output of the plant.

# %%
import numpy as np

cycle, speed = result["controller.cycle"], result["actuator.impact_speed"]
hardest = [np.abs(speed[cycle == k]).max() for k in range(1, 41)]
for k in (0, 1, 2, 3, 5, 10, 20, 38):
    print(f"cycle {k + 1:2d}: {hardest[k]:.2f} m/s {'#' * int(50 * hardest[k])}")

# %% [markdown]
# The gap in the first cycle, and in the last one:

# %%
from matplotlib.figure import Figure

figure = Figure(figsize=(8.0, 3.5), layout="constrained")
axis = figure.subplots()
for k in (1, 3, 39):
    part = cycle == k
    times = result.times[part] - result.times[part][0]
    axis.plot(1e3 * times, 1e3 * result["actuator.position"][part], label=f"cycle {k}")
axis.set(xlabel="time since the cycle began / ms", ylabel="gap / mm")
axis.legend()
figure.savefig("landing.png")
figure

# %% [markdown]
# [How it works](../run-to-run.md), and [the numbers of 200 valves](../run-to-run-study.md).
