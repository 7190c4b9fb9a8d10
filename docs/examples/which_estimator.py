# %% [markdown]
# # Which estimator
#
# Four ways to the position on the same signals. The actuator has eddy currents and hysteresis, which the estimators do not know. Its coil is warm: 53 Ohm, where they believe 48 Ohm.

# %%
import numpy as np

import gapsense

dt = 20e-6
time = dt * np.arange(4000)
voltage = np.where(time % 20e-3 < 10e-3, 30.0, 0.0)
actuator = gapsense.ReluctanceActuator(coil_resistance=53.0).run(voltage, sample_time=dt)
current = actuator.current + 2e-3 * np.random.default_rng(1).standard_normal(time.size)

# %% [markdown]
# With a contact sensor, `Ekf` gives the position at once. A resistance that `Semera` finds meanwhile is one more input.

# %%
semera = gapsense.Semera(prior_resistance=48.0).run(voltage, current, sample_time=dt)
ekf = gapsense.Ekf().run(voltage, current, actuator.mode, sample_time=dt)
wired = gapsense.Ekf().run(voltage, current, actuator.mode, semera.resistance, sample_time=dt)
print(f"resistance by Semera: {semera.resistance[-1]:.1f} Ohm")

# %% [markdown]
# `Mhe` needs neither a contact sensor nor the right resistance: it learns the device from each motion.

# %%
mhe = gapsense.Mhe().run(voltage, current, sample_time=dt)
print(f"resistance by Mhe: {mhe.resistance[-1]:.1f} Ohm")

# %% [markdown]
# `Ertss` publishes each motion once more after its landing, smoothed, each sample with the time that it is about.

# %%
ertss = gapsense.Ertss().run(voltage, current, actuator.mode, semera.resistance, sample_time=dt)
is_published = ertss.smoothed_published > 0.5
about = np.rint(ertss.smoothed_time[is_published] / dt).astype(int)
smoothed = np.full(time.size, np.nan)
smoothed[about] = ertss.smoothed_position[is_published]

# %% [markdown]
# The error while the armature moves, from the second cycle on:

# %%
found = {"Ekf": ekf.position, "Ekf with Semera": wired.position, "Ertss with Semera": smoothed, "Mhe": mhe.position}
counts = (actuator.mode == 2.0) & (time > 20e-3)
for name, position in found.items():
    error = 1e6 * (position - actuator.position)[counts]
    print(f"{name:18} {np.sqrt(np.nanmean(error**2)):4.0f} um")

# %%
from matplotlib.figure import Figure

figure = Figure(figsize=(8.0, 4.0), layout="constrained")
axis = figure.subplots()
for name, position in found.items():
    axis.plot(1e3 * time, 1e6 * np.where(counts, position - actuator.position, np.nan), label=name)
axis.set(xlabel="time / ms", ylabel="error of the position / um", xlim=(20.0, 40.0))
axis.legend()
figure.savefig("estimators.png")
figure

# %% [markdown]
# [All estimators under eighteen conditions](../estimators.md)
