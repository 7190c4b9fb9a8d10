# %% [markdown]
# # Your own valve, from a record
#
# `sample_valve.csv` comes with Gapsense. Put a file of your own in its place: time, voltage and current of whole operations, recorded from rest on.
# First, what is in the record?

# %%
import gapsense

record = gapsense.inspect("sample_valve.csv")
print(record)

# %%
record.plot()

# %% [markdown]
# No record tells the stops, the gap law and where the spring is relaxed. `sample_valve.toml` has them.
# A second record, at another voltage, is kept to validate what was found.

# %%
valve = gapsense.identify(
    "sample_valve.csv", parameters="sample_valve.toml", validate="sample_valve_22V.csv", out="valve.toml"
)
for name in ("coil.resistance", "mover.mass", "spring.stiffness", "damping"):
    print(f"{name:18} {valve.parameters[name]:.4g}")
print("the model explains the record:", valve.passed)

# %%
valve.plot()

# %% [markdown]
# With these parameters estimators run on the record, or on arrays as `gapsense.Mhe.from_file("valve.toml").run(...)`.

# %%
estimates = gapsense.estimate("sample_valve.csv", estimator="Mhe", parameters="valve.toml")
position = estimates.signals["Mhe.position"]
print(f"gap from {1e3 * position.min():.2f} mm to {1e3 * position.max():.2f} mm")

# %%
estimates.plot()
