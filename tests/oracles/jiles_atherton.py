"""Jiles-Atherton as the textbook has it: irreversible magnetization over the field, by SciPy."""

import numpy as np
from scipy.integrate import solve_ivp

MU_0 = 4e-7 * np.pi


def branch(start, H, par):
    """H_e and M_irr along the field from H[0] to H[-1], monotonic, starting with `start`.

    dM_irr/dH_e = max(0, delta (M_an - M_irr)) / kappa, M = (1 - c) M_irr + c M_an, H_e = H + alpha M.
    """
    M_sat, a, alpha, kappa, c = par
    delta = np.sign(H[-1] - H[0])

    def anhysteretic(H_e):
        x = H_e / a
        if abs(x) < 1e-3:
            return M_sat * x / 3.0, M_sat / (3.0 * a)
        return M_sat * (1.0 / np.tanh(x) - 1.0 / x), M_sat / a * (1.0 / x**2 - 1.0 / np.sinh(x) ** 2)

    def rates(_, y):
        H_e, M_irr = y
        M_an, slope = anhysteretic(H_e)
        irreversible = max(0.0, delta * (M_an - M_irr)) / kappa
        chi = (1.0 - c) * irreversible + c * slope
        stretch = 1.0 / (1.0 - alpha * chi)  # dH_e/dH
        return [stretch, irreversible * stretch]

    run = solve_ivp(rates, (H[0], H[-1]), start, t_eval=H, rtol=1e-10, atol=1e-6, max_step=abs(H[-1] - H[0]) / 500)
    M = (1.0 - c) * run.y[1] + c * np.array([anhysteretic(H_e)[0] for H_e in run.y[0]])
    return run.y[:, -1], MU_0 * (H + M)


def closed_loop(peak, par, cycles=8, points=4001):
    """Field and flux density of the symmetric loop up to `peak` [A/m], some cycles after the demagnetized state."""
    state, _ = branch([0.0, 0.0], np.linspace(0.0, peak, points), par)
    for _ in range(cycles):
        down, up = np.linspace(peak, -peak, points), np.linspace(-peak, peak, points)
        state, B_down = branch(state, down, par)
        state, B_up = branch(state, up, par)
    return np.concatenate([down, up]), np.concatenate([B_down, B_up])
