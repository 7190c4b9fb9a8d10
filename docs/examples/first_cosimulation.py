# %% [markdown]
# # A first co-simulation
#
# A drive, an actuator, a noisy sensor and a Kalman filter, wired and run in one process.
# Each component is an FMU; here they are those that come with Gapsense.

# %%
from gapsense import Scenario

s = Scenario("my actuator", stop=40e-3, base_step=20e-6)
s.add("drive", "DriveVoltage", {"square.amplitude": 30.0, "square.period": 20e-3}, enable=1.0, reference=0.0)
s.add("actuator", "ReluctanceActuator", damping=0.6)
s.add("sensor", "Sensor", {"sample_time": 20e-6, "noise.current": 2e-3}, seed=1)
s.add("ekf", "Ekf", {"damping": 0.6, "noise.current": 2e-3}, resistance=0.0)

# %% [markdown]
# `connect` takes an output and the inputs it goes to. Of two components it connects each output to the input of the same name.

# %%
s.connect("drive.voltage_mean", "actuator.voltage", "sensor.voltage").connect("actuator", "sensor")
s.connect("sensor.voltage_measured", "ekf.voltage").connect("sensor.current_measured", "ekf.current")
s.connect("sensor.mode_measured", "ekf.mode")
s.check()

# %% [markdown]
# An empty list: nothing is wrong. `run` gives the signals as arrays.

# %%
result = s.run()
print(result)
result.plot("sensor.current_measured", "actuator.position", "ekf.position")

# %% [markdown]
# The FMUs stay loaded, so a run with other values costs no more than its steps.
# Here the coil gets warm, and the filter does not know.

# %%
for resistance in (48.0, 50.0, 53.0):
    warm = s.set("actuator.coil.resistance", resistance).run()
    error = warm["ekf.position"] - warm["actuator.position"]
    print(f"{resistance:.0f} Ohm: RMS error of the position {1e6 * (error**2).mean() ** 0.5:.0f} um")
