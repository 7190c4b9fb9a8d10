"""Moving-horizon estimator: `model` runs on the voltage, `window` passes it through samples, `solve` corrects it.

The kernel is `mhe`. Numbers like (5) are those of `fmus/mhe/page.md`.
"""
