#!/usr/bin/env python3
"""Computes the numbers and draws the pictures of the theory pages, the map of torque over speed,
and the system.

    python3 docs/pictures/theory.py            writes the pictures and the generated tables of the pages
    python3 docs/pictures/theory.py --check    fails if pictures, tables or numbers of the pages differ from what it computes
    python3 docs/pictures/theory.py --print    prints every number by its name

The motor is `motors/dissertation.toml`. Constants of the control and of the simulated motor are read from the Rust sources, so that
the check fails when a page no longer describes the code. Standard library only.
"""

import cmath
import functools
import json
import math
import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
DOCS = ROOT / "docs"
PICTURES = DOCS / "pictures"
TAU = 2 * math.pi
DEG = 180 / math.pi


# ---------------------------------------------------------------------------------------------------------------- sources of numbers


def source(path):
    return (ROOT / path).read_text(encoding="utf-8")


def constant(path, name):
    """Returns the value of a Rust constant or of the default of a setting that is a plain number."""
    found = re.search(rf"\b{name}: f(?:32|64) = ([-0-9.e_]+)", source(path))
    if not found:
        sys.exit(f"{path}: no number {name}")
    return float(found.group(1).replace("_", ""))


def sections(path, name):
    """Returns the second-order sections of a filter as rows of b0, b1, b2, a1, a2."""
    text = source(path).split(f"pub const {name}:")[1].split("]);")[0]
    rows = re.findall(r"\[([-0-9., ]+)\]", text)
    return [[float(x) for x in row.split(",")] for row in rows]


ESTIMATOR = "drive-core/settings/src/settings/design/estimator.rs"
FILTER = "drive-core/src/flux/angle_filter.rs"
OBSERVER = "drive-core/src/flux/observer.rs"
INVERTER = "hil-sim/plant/src/inverter.rs"
MACHINE = "hil-sim/plant/src/machine.rs"
FILTERS = "drive-core/src/filter/dissertation.rs"
SETTINGS = "drive-core/settings/src/settings/list.rs"


class Motor:
    """The motor of the file, with the d-axis current and the injection of the drive's default settings."""

    def __init__(self):
        with open(ROOT / "motors/dissertation.toml", "rb") as file:
            data = tomllib.load(file)
        m = data["motor"]
        self.r_s, self.r_r, self.l_m = m["r_s"], m["r_r"], m["l_m"]
        self.pairs, self.inertia = m["pole_pairs"], m["inertia"]
        self.l_s, self.l_r = m["l_ls"] + m["l_m"], m["l_lr"] + m["l_m"]
        self.k_r = self.l_m / self.l_r
        self.coupled = self.k_r * self.l_m  # L_M = L_m^2/L_r
        self.sigma_ls = self.l_s - self.coupled
        self.sigma = self.sigma_ls / self.l_s
        self.tau = self.l_r / self.r_r
        self.alpha = 1 / self.tau
        self.r_rotor = self.k_r**2 * self.r_r  # R_R
        plate = data["nameplate"]
        self.rated_rpm = plate["speed_rpm"]
        self.rated_nm = plate["power_w"] / (TAU / 60 * self.rated_rpm)
        self.rated_flux = math.sqrt(2 / 3) * plate["voltage_v"] / (TAU * plate["frequency_hz"])
        self.dc_link = data["inverter"]["dc_link_v"]

    def torque(self, i_d, i_q):
        return 1.5 * self.pairs * self.coupled * i_d * i_q


M = Motor()
I_D = 0.7  # A, `sequence.i_d` of this motor: section 3.10 of the source
LIMIT = 3.5  # A, `limits.current_a` of this motor
I_D_HIGH = 2.31  # A, `sequence.flux = high`
A_PSI = constant(MACHINE, "a_psi")
B1 = constant(MACHINE, "b1")
F_S = 6000.0
F_INJ = 600.0
OMEGA = TAU * F_INJ
V_INJ = 50.0  # V peak
RESIDUAL = 4 / math.pi * constant(INVERTER, "residual_v")  # V, fundamental of a voltage with the sign of each phase current
NOISE = constant(ESTIMATOR, "NOISE_A")


# ------------------------------------------------------------------------------------------------------------------------- saliency


def tensor(i, psi_share):
    """The saliency vector s of model A in the frame of i and psi; psi_share is the flux over its nominal value (complex)."""
    r = abs(psi_share) ** 2
    flux = A_PSI * psi_share**2 * 2 / (1 + r)
    current = B1 * i * i / abs(i) if abs(i) > 1e-12 else 0
    return flux + current


def signal(s):
    """q of the synchronous demodulation for the saliency vector s in the estimated flux frame, Eq. T14."""
    return s.imag / (1 - s.real)


def q_slow(i_d, i_q, e, follows=True, nominal=I_D):
    """Signal q for a lasting angle error: the current stays in the estimated frame. With `follows` the flux settles too."""
    i = complex(i_d, i_q)
    share = i_d / nominal
    if follows:
        share = (i * cmath.exp(-1j * e)).real / nominal
    return signal(tensor(i, share * cmath.exp(1j * e)))


def q_fast(i_d, i_q, e, nominal=I_D):
    """Signal q for an angle error faster than current loop and flux: the frame turns, current and flux stay where they are."""
    i = complex(i_d, i_q) * cmath.exp(1j * e)
    return signal(tensor(i, i_d / nominal * cmath.exp(1j * e)))


def slope(q, i_q, i_d=I_D, h=1e-5, **more):
    return (q(i_d, i_q, h, **more) - q(i_d, i_q, -h, **more)) / (2 * h)


def zeros(f, low, high, steps=3600):
    """Returns the places where f changes its sign."""
    found = []
    xs = [low + (high - low) * n / steps for n in range(steps + 1)]
    ys = [f(x) for x in xs]
    for (a, fa), (b, fb) in zip(zip(xs, ys), zip(xs[1:], ys[1:])):
        if fa == 0 or fa * fb < 0:
            for _ in range(60):
                c = 0.5 * (a + b)
                if f(a) * f(c) <= 0:
                    b = c
                else:
                    a = c
            found.append(0.5 * (a + b))
    return found


def restoring(i_q, e, i_d=I_D):
    """q - q_ref of a lasting error, in the direction that reduces e: positive pulls back."""
    return q_slow(i_d, i_q, e, nominal=I_D) - q_slow(i_d, i_q, 0, nominal=I_D)


def barrier(i_q, i_d=I_D):
    """Largest restoring signal on the side of more slip (negative e for positive i_q), and its angle."""
    gamma = math.atan2(i_q, i_d)
    low = gamma - math.pi / 2
    best = max((abs(restoring(i_q, low * n / 2000, i_d)), low * n / 2000) for n in range(1, 2000))
    return best


# -------------------------------------------------------------------------------------------------------------------------- filters


def response(rows, freq):
    z = cmath.exp(1j * TAU * freq / F_S)
    h = 1
    for b0, b1, b2, a1, a2 in rows:
        h *= (b0 + b1 / z + b2 / z**2) / (1 + a1 / z + a2 / z**2)
    return h


# ----------------------------------------------------------------------------------------------------------------- noise and filter


def plant_600(v):
    """Amplitude of the sampled injection current, A, as `Injection::new` computes it, for v V peak."""
    r = M.r_s + M.r_rotor
    p = math.exp(-r / (M.sigma_ls * F_S))
    k = (1 - p) / r
    return v * k / abs(cmath.exp(1j * TAU * F_INJ / F_S) - p)


C_INJ = plant_600(V_INJ)
T = 10 / F_S  # injection period, s
SENSORS = 4 / 3  # mean variance of a direction, relative to that of the sensors of phases a and b
WHITE = math.sqrt(2 * SENSORS / 10)  # deviation of an amplitude in an injection period, relative to a sensor's, as white noise


class AngleFilter:
    """The Kalman filter of the angle (drive-core/src/flux/angle_filter.rs), its covariance and its gains."""

    def __init__(self, i_q, rotor, i_d=I_D, noise=NOISE, a=None, observer=True, hz=None):
        """rotor: electrical speed, rad/s. Without `observer`, z1 alone with the poles of Butterworth at hz."""
        a = A_PSI if a is None else a
        flux = M.coupled * i_d
        per_a = M.sigma_ls / (flux * T)
        self.per_saliency = 1 / (2 * a)
        saliency = constant(ESTIMATOR, "AVERAGED_NOISE") * noise / C_INJ
        self.r1 = (saliency * self.per_saliency) ** 2
        self.r2 = (constant(ESTIMATOR, "SEEN_NOISE") * noise * per_a) ** 2
        if hz:
            self.rate = self.r1 * T * (TAU * hz) ** 6
        else:
            self.rate = (constant(ESTIMATOR, "LOAD_STEP") * M.rated_nm * M.pairs / M.inertia) ** 2
        self.slow_s = min(constant(ESTIMATOR, "SLOW_OF_TAU_R") * M.tau, constant(ESTIMATOR, "SLOW_S"))
        slip = M.alpha * math.sqrt(LIMIT**2 - i_d**2) / i_d  # at the current limit
        self.slow = math.hypot(constant(ESTIMATOR, "SLOW"), constant(ESTIMATOR, "SLOW_OF_RATED") * TAU * 60, constant(ESTIMATOR, "SLOW_OF_SLIP") * slip)
        al, w = M.alpha, rotor
        gain = 2 * (constant(OBSERVER, "GAIN_AT_STANDSTILL") * al + constant(OBSERVER, "GAIN_PER_SPEED") * abs(w)) / (al * al + w * w)
        self.alpha = al if observer else 0.0  # of the filter
        self.l = gain * w * w - al
        y = constant(ESTIMATOR, "SATURATED") * (flux / M.rated_flux) ** constant(ESTIMATOR, "KNEE")
        self.delta = self.alpha * (1 + (constant(ESTIMATOR, "KNEE") + 1) * y) / (1 + y)
        self.grown = w * (1 + gain * self.delta)
        self.h = M.r_s * (i_q - gain * w * i_d) / flux
        self.observer = observer
        self.i_q, self.i_d, self.rotor = i_q, i_d, rotor
        self.decay = T / constant(OBSERVER, "RESISTANCE_S")
        self.settle()

    def settle(self, periods=12000):
        kept, r_kept = 1 - T / self.slow_s, 1 - self.decay
        growth = constant(FILTER, "GROWTH")
        # The rotor equation turns (e, d) by the slip, and both decay; a sample later the rest of F.
        turn, decay, shorter = self.alpha * T * self.i_q / self.i_d, math.exp(-self.alpha * T), math.exp(-self.delta * T)
        c, s = math.cos(turn), math.sin(turn)
        f = [
            [decay * c, T, 0, 0, 0, -decay * s],
            [0, 1, T, 0, 0, 0],
            [0, 0, 1, 0, 0, 0],
            [0, 0, 0, r_kept, 0, 0],
            [0, 0, 0, 0, kept, 0],
            [shorter * s, 0, 0, 0, 0, shorter * c],
        ]
        noise = [0, constant(ESTIMATOR, "SLIP") ** 2, self.rate, 0.01**2, 2 / self.slow_s * self.slow**2, (1 - math.exp(-2 * self.delta * T)) / T * growth**2]
        first = [0.1**2, 5.0**2, 100.0**2, constant(OBSERVER, "MEASURED") ** 2, self.slow**2, growth**2]
        n = range(6)
        p = [[first[i] if i == j else 0.0 for j in n] for i in n]
        last = 0
        for step in range(periods):
            fp = [[sum(f[i][k] * p[k][j] for k in n if f[i][k]) for j in n] for i in n]
            p = [[sum(fp[i][k] * f[j][k] for k in n if f[j][k]) + (T * noise[i] if i == j else 0) for j in n] for i in n]
            before = p[0][0]
            self.k2 = [0.0] * 6
            if self.observer:
                h = [self.l, 1, 0, self.h, 1, self.grown]
                p, self.k2 = reduced(p, h, self.r2)
            p, self.k1 = reduced(p, [1, 0, 0, 0, 0, 0], self.r1)
            if step % 200 == 199:
                if abs(p[0][0] / (last or 1) - 1) < 1e-9:
                    break
                last = p[0][0]
        self.p = p
        self.deg = math.sqrt(p[0][0]) * DEG
        self.prior_deg = math.sqrt(before) * DEG

    def loop(self, freq, pull=True, fast=1.0):
        """Open loop at z1 at a frequency, Hz: from the angle that the saliency shows to the angle error after one pass.

        The flux is in it: it follows the frame with tau_r. The demodulation delays by 19 samples and is applied 6 samples later,
        for ten samples; the observer's measurement closes its own loop around it.
        """
        s = 1j * TAU * freq
        w, ts = TAU * freq, 1 / F_S
        z = cmath.exp(s * T)
        mean20 = math.sin(10 * w * ts) / (20 * math.sin(w * ts / 2))
        d1 = mean20**2 * cmath.exp(-s * 25 * ts) * fast
        hold = (1 - cmath.exp(-s * T)) / (s * T)
        d2 = hold
        t = self.i_q / self.i_d
        # unknowns: e, m, w_hat, a_hat, r_hat, b_hat, d_hat, z2 (after the subtraction of what the filter expects)
        inv = 1 / M.tau if pull else 0.0
        k1, k2 = self.k1, self.k2
        # update by z2: x = k2 (z2 - ...), then by z1: k1 (z1 - x_e)
        g = [k2[n] - k1[n] * k2[0] for n in range(6)]  # share of z2 in the corrections
        # correction c_n = g_n z2 + k1_n z1
        names = "e m w a r b d z2".split()
        rows, right = [], []

        def row(rhs, **terms):
            rows.append([terms.get(name, 0) for name in names])
            right.append(rhs)

        # e' = -(e + t m)/tau - w - c_e/T + alpha t d, the corrections held for a period
        row(-hold * k1[0] / T, e=s + inv, m=t * inv, w=hold, d=-hold * self.alpha * t, z2=hold * g[0] / T)
        row(0, m=s + 1 / M.tau, e=-t / M.tau)
        row(k1[1], w=z - 1, a=-T, z2=-g[1])
        row(k1[2], a=z - 1, z2=-g[2])
        row(k1[3], r=z - 1 + self.decay, z2=-g[3])
        row(k1[4], b=z - (1 - T / self.slow_s), z2=-g[4])
        row(k1[5], d=z - (1 - T * self.delta), z2=-g[5])
        if self.observer:
            row(0, z2=1, w=1, b=1, r=self.h, d=self.grown, e=-d2 * self.l, m=-d2 * self.grown)
        else:
            row(0, z2=1)
        x = solve(rows, right)
        return -d1 * x[0]

    @functools.cache
    def noise_deg(self, **more):
        """Standard deviation of the angle error, degrees, that the noise of the sensors causes through z1 in the closed loop."""
        deviation = WHITE * NOISE / C_INJ * abs(self.per_saliency)
        freqs = [0.05 * 1.03**n for n in range(290)]
        total = 0.0
        last = None
        for f in freqs:
            ratio = self.loop(f, **more)
            s = 1j * TAU * f
            mean20 = math.sin(10 * TAU * f / F_S) / (20 * math.sin(TAU * f / F_S / 2))
            d1 = mean20**2 * cmath.exp(-s * 25 / F_S)
            power = abs(ratio / (1 + ratio) / d1) ** 2 if abs(d1) > 1e-6 else 0.0
            # the noise itself has passed the averages
            power *= abs(mean20) ** 4
            if last is not None:
                total += 0.5 * (power + last[1]) * (f - last[0])
            last = (f, power)
        return deviation * math.sqrt(2 * T * total) * DEG

    @functools.cache
    def margins(self, **more):
        """Crossover in Hz, phase margin in degrees, gain margin as a factor (up and down), sensitivity peak."""
        freqs = [0.05 * 1.015**n for n in range(580)]
        points = [(f, self.loop(f, **more)) for f in freqs]
        peak = max(abs(1 / (1 + l)) for _, l in points)
        crossings = [
            (f1, 180 + cmath.phase(l1) * DEG) for (f0, l0), (f1, l1) in zip(points, points[1:]) if abs(l0) >= 1 > abs(l1)
        ]
        up = down = None
        for (f0, l0), (f1, l1) in zip(points, points[1:]):
            if l0.imag * l1.imag < 0 and (l0.real + l1.real) < 0:
                size = 0.5 * abs(l0 + l1)
                if size < 1:
                    up = min(up or 1e9, 1 / size)
                else:
                    down = max(down or 0, 1 / size)
        freq, margin = crossings[-1] if crossings else (None, None)
        return freq, (margin + 180) % 360 - 180 if margin is not None else None, up, down, peak


Filter = functools.cache(AngleFilter)


def reduced(p, h, variance):
    n = range(len(h))
    ph = [sum(p[i][j] * h[j] for j in n) for i in n]
    expected = sum(h[i] * ph[i] for i in n) + variance
    gain = [x / expected for x in ph]
    return [[p[i][j] - gain[i] * ph[j] for j in n] for i in n], gain


def solve(rows, right):
    """Gaussian elimination with complex numbers."""
    n = len(rows)
    a = [list(map(complex, row)) + [complex(b)] for row, b in zip(rows, right)]
    for k in range(n):
        pivot = max(range(k, n), key=lambda i: abs(a[i][k]))
        a[k], a[pivot] = a[pivot], a[k]
        for i in range(k + 1, n):
            share = a[i][k] / a[k][k]
            if share:
                a[i] = [x - share * y for x, y in zip(a[i], a[k])]
    x = [0j] * n
    for k in reversed(range(n)):
        x[k] = (a[k][n] - sum(a[k][j] * x[j] for j in range(k + 1, n))) / a[k][k]
    return x


# ----------------------------------------------------------------------------------------------------------- voltage, slip, false lock


def voltage_error(f_stator, d_ohm=0.0, d_volt=0.0, i_q=1.0, i_d=I_D):
    """Angle error of a flux that is integrated from the voltage, degrees, Eq. O7; along the current for a voltage error."""
    i = complex(i_d, i_q)
    wrong = d_ohm * i + d_volt * i / abs(i)
    flux = M.coupled * i_d
    return abs(cmath.phase(1 + 1j * wrong / (TAU * f_stator * flux))) * DEG


def flux_angle(i_q, share, i_d=I_D):
    """Angle error, rad, and flux over its nominal value, if the rotor has `share` times the resistance of the settings, Eq. O12."""
    gamma = math.atan2(i_q, i_d)
    true = math.atan(math.tan(gamma) / share)
    return gamma - true, math.cos(true) / math.cos(gamma)


def torque_share(i_q, share, i_d=I_D):
    gamma = math.atan2(i_q, i_d)
    error, _ = flux_angle(i_q, share, i_d)
    return math.sin(2 * (gamma - error)) / math.sin(2 * gamma)


def fixed_frame(i_q, rpm, i_d=I_D):
    """Flux (complex, over L_M i_d, in the frame), torque in Nm and angle error in rad, if the frame is fixed, Eq. T26 to T28."""
    w = rpm * TAU / 60 * M.pairs
    i = complex(i_d, i_q)
    psi = M.r_rotor * i / (M.alpha - 1j * w)
    torque = 1.5 * M.pairs * (psi.conjugate() * i).imag
    return psi / (M.coupled * i_d), torque, cmath.phase(psi)


def lock_rpm(i_q, i_d=I_D):
    return -i_q / (i_d * M.tau) * 60 / TAU / M.pairs


def mismatch(gain):
    """Length of the asymmetry n of a gain mismatch (drive-core/src/carrier/asymmetry.rs)."""
    return 0.5 * gain * math.hypot(1, 1 / math.sqrt(3))


# --------------------------------------------------------------------------------------------------------------------- identification


def expm(a, h, terms=24):
    """e^(A h) and the integral of e^(A t) from 0 to h, for a 2 by 2 matrix."""
    one = [[1, 0], [0, 1]]
    times = lambda x, y: [[sum(x[i][k] * y[k][j] for k in (0, 1)) for j in (0, 1)] for i in (0, 1)]
    f, integral, term = one, [[h, 0], [0, h]], one
    for n in range(1, terms):
        term = [[x * h / n for x in row] for row in times(term, a)]
        f = [[x + y for x, y in zip(*rows)] for rows in zip(f, term)]
        integral = [[x + y * h / (n + 1) for x, y in zip(*rows)] for rows in zip(integral, term)]
    return f, integral


def sampled(w, h):
    """Coefficients f1, f0, h1, h0 of the sampled equation of the motor (Eq. 14 to 18 of the paper), without approximation."""
    k = (M.l_s - M.sigma_ls) / M.sigma_ls
    rotor = complex(M.alpha, -w)
    a = [[-(M.r_s / M.sigma_ls + k * M.alpha), rotor * k], [M.alpha, -rotor]]
    f, integral = expm(a, h)
    b = [integral[0][0] / M.sigma_ls, integral[1][0] / M.sigma_ls]
    return f[0][0] + f[1][1], f[0][1] * f[1][0] - f[1][1] * f[0][0], b[0], f[0][1] * b[1] - f[1][1] * b[0]


def model_b(f1, f0, h1, h0, h):
    t2, t4, t5, t6 = -f1.imag, -f0.imag, h1.real, h0.real
    sls = h / t5
    tau = h * t5 / (t5 + t6)
    r_s = (t2 + t4) / (t2 * t5)
    return r_s, tau, sls, (sls * (2 - f1.real) / h - r_s) * tau, -t2 / h


def model_c(f1, f0, h1, h0, h):
    f22 = -h0 / h1
    f11 = f1 - f22
    fd = f0 + f22 * f11
    sls = h * (1 + f11.real) / (2 * h1.real)
    a = -1 + f22.real + f22.imag**2 / 2
    b = h * (1 + fd.imag / (2 * f22.imag))
    tau = (-b - math.sqrt(max(0.0, b * b + 2 * h * h * a))) / (2 * a)
    r_s = (f1.imag + f0.imag) * sls / (h * f1.imag)
    return r_s, tau, sls, (sls * (2 - f1.real) / h - r_s) * tau, f1.imag / h


def model_d(f1, f0, h1, h0, h):
    root = cmath.sqrt(f1 * f1 / 4 + f0)
    z = [f1 / 2 + root, f1 / 2 - root]
    s = [cmath.log(x) / h for x in z]
    r = [(h1 * z[0] + h0) / (z[0] - z[1]), (h1 * z[1] + h0) / (z[1] - z[0])]
    r = [x * p / (y - 1) for x, p, y in zip(r, s, z)]
    b1, b0 = r[0] + r[1], -(r[0] * s[1] + r[1] * s[0])
    a1, a0 = -(s[0] + s[1]), s[0] * s[1]
    sls, tau, r_s = 1 / b1.real, 1 / (b0 / b1).real, (a0 / b0).real
    return r_s, tau, sls, (a1.real * sls - r_s) * tau, -a1.imag


def bias(model, w, h):
    true = (M.r_s, M.tau, M.sigma_ls, M.l_s, w)
    return [100 * (x / t - 1) for x, t in zip(model(*sampled(w, h), h), true)]


def ud_update(u, d, theta, x, y, forget):
    """One step of Eq. I18 to I23 on lists; returns the prediction error."""
    n = len(x)
    error = y - sum(a * b for a, b in zip(x, theta))
    alpha, gain = forget, [0j] * n
    for j in range(n):
        w = x[j] + sum(u[i][j] * x[i] for i in range(j))
        g = d[j] * w.conjugate()
        after = alpha + (w * g).real
        d[j] *= alpha / (after * forget)
        for i in range(j):
            old = u[i][j]
            u[i][j] = old - gain[i] * w / alpha
            gain[i] += old * g
        gain[j] = g
        alpha = after
    for i in range(n):
        theta[i] += gain[i] * error / alpha
    return error


def ud_matches():
    """Largest difference of U D U^H from the recursion on P over 40 steps of random data, relative to the largest element."""
    seed = 7

    def draw():
        nonlocal seed
        seed = (seed * 1664525 + 1013904223) % 2**32
        return seed / 2**31 - 1

    n = 4
    u = [[1.0 if i == j else 0j for j in range(n)] for i in range(n)]
    d, theta, forget = [10.0] * n, [0j] * n, 0.9
    p = [[10.0 if i == j else 0j for j in range(n)] for i in range(n)]
    worst = 0.0
    for _ in range(40):
        x = [complex(draw(), draw()) for _ in range(n)]
        ud_update(u, d, theta, x, complex(draw(), draw()), forget)
        px = [sum(p[i][k] * x[k].conjugate() for k in range(n)) for i in range(n)]
        s = forget + sum(x[i] * px[i] for i in range(n)).real
        p = [[(p[i][j] - px[i] * px[j].conjugate() / s) / forget for j in range(n)] for i in range(n)]
        back = [[sum(u[i][k] * d[k] * complex(u[j][k]).conjugate() for k in range(n)) for j in range(n)] for i in range(n)]
        size = max(abs(x) for row in p for x in row)
        worst = max(worst, max(abs(back[i][j] - p[i][j]) for i in range(n) for j in range(n)) / size)
    return worst


# --------------------------------------------------------------------------------------------------------------------------- drawing

INK, GREY, GRID = "#1f2328", "#57606a", "#d8dee4"
BLUE, ORANGE, GREEN, PURPLE, RED = "#0b5cad", "#c2410c", "#1a7f37", "#7c3aed", "#b91c1c"
WIDE = 480
STYLE = (
    "text{font-family:system-ui,'DejaVu Sans',Arial,sans-serif;font-size:14px;fill:" + INK + ";"
    "paint-order:stroke;stroke:#fff;stroke-width:4px;stroke-linejoin:round}"
    ".s{font-size:13px}.g{fill:" + GREY + "}.b{font-weight:600}path,line{fill:none}"
)


def num(x):
    return f"{x:.1f}".removesuffix(".0").replace("-0", "-0") if abs(x) > 0.05 else "0"


def label(x, digits=None):
    text = f"{x:.{digits}f}" if digits is not None else f"{x:g}"
    return text.replace("-", "−")


def escape(text):
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


class Picture:
    """A picture of panels below each other."""

    def __init__(self, name, about):
        self.name, self.about, self.parts, self.height = name, about, [], 0

    def panel(self, *args, **more):
        panel = Panel(self, *args, **more)
        return panel

    def add(self, part):
        self.parts.append(part)

    def line(self, x1, y1, x2, y2, color=INK, width=1.5, dash=None, arrow=False):
        extra = f' stroke-dasharray="{dash}"' if dash else ""
        if arrow:
            extra += f' marker-end="url(#{self.arrow(color)})"'
        self.add(f'<line x1="{num(x1)}" y1="{num(y1)}" x2="{num(x2)}" y2="{num(y2)}" stroke="{color}" stroke-width="{width}"{extra}/>')

    def arrow(self, color):
        key = "a" + color[1:]
        self.arrows = getattr(self, "arrows", {})
        self.arrows[key] = (
            f'<marker id="{key}" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" orient="auto">'
            f'<path d="M0 1L10 5L0 9z" style="fill:{color}"/></marker>'
        )
        return key

    def text(self, x, y, text, color=INK, anchor="start", style="", turn=None):
        extra = f' class="{style}"' if style else ""
        if color != INK:
            extra += f' style="fill:{color}"'
        if anchor != "start":
            extra += f' text-anchor="{anchor}"'
        if turn is not None:
            extra += f' transform="rotate({turn} {num(x)} {num(y)})"'
        self.add(f'<text x="{num(x)}" y="{num(y)}"{extra}>{escape(text)}</text>')

    def path(self, points, color=BLUE, width=2, dash=None, fill=None):
        data = "M" + "L".join(f"{num(x)} {num(y)}" for x, y in points)
        extra = f' stroke-dasharray="{dash}"' if dash else ""
        if fill:
            extra += f' style="fill:{fill}"'
        self.add(f'<path d="{data}" stroke="{color}" stroke-width="{width}" stroke-linejoin="round"{extra}/>')

    def box(self, x, y, w, h, lines, color):
        self.add(f'<rect x="{x}" y="{y}" width="{w}" height="{h}" rx="5" fill="{color}" fill-opacity="0.08" stroke="{color}" stroke-width="1.6"/>')
        for n, text in enumerate(lines):
            self.text(x + w / 2, y + h / 2 + 5 + 17 * (n - (len(lines) - 1) / 2), text, color if n == 0 else GREY, "middle", "" if n == 0 else "s")

    def chain(self, x, y, names, color=BLUE, gap=17, h=34, back=False):
        """Draws boxes in a row, joined by arrows, from the right to the left if `back`; returns where the row ends."""
        for n, (name, w) in enumerate(names):
            x -= w if back else 0
            self.box(x, y, w, h, [name], color)
            x += 0 if back else w
            if n < len(names) - 1:
                step = -gap if back else gap
                self.line(x, y + h / 2, x + step, y + h / 2, color, 1.6, arrow=True)
                x += step
        return x

    def sum(self, x, y, color=INK):
        self.add(f'<circle cx="{x}" cy="{y}" r="9" fill="#fff" stroke="{color}" stroke-width="1.6"/>')
        self.text(x, y + 5, "+", color, "middle")

    def dot(self, x, y, color=INK, r=4, hollow=False):
        fill = "#fff" if hollow else color
        self.add(f'<circle cx="{num(x)}" cy="{num(y)}" r="{r}" fill="{fill}" stroke="{color}" stroke-width="2"/>')

    def svg(self):
        arrows = "".join(getattr(self, "arrows", {}).values())
        defs = f"<defs>{arrows}</defs>\n" if arrows else ""
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDE} {num(self.height)}" role="img" aria-label="{escape(self.about)}">\n'
            f"<style>{STYLE}</style>\n{defs}"
            f'<rect width="{WIDE}" height="{num(self.height)}" fill="#fff"/>\n'
        )
        return head + "\n".join(self.parts) + "\n</svg>\n"


class Panel:
    """A plot with axes, below what the picture has already."""

    def __init__(self, picture, x, y, x_ticks, y_ticks, x_label, y_label, height=260, log=(False, False), title=None, left=64):
        self.p, self.log = picture, log
        top = picture.height + (34 if title else 16)
        self.x0, self.x1, self.y0, self.y1 = left, WIDE - 18, top + height, top
        self.rx, self.ry = x, y
        picture.height = self.y0 + 56
        if title:
            picture.text(self.x0, top - 12, title, style="b")
        for at in x_ticks:
            px = self.x(at)
            picture.line(px, self.y0, px, self.y1, GRID, 1)
            picture.text(px, self.y0 + 19, label(at), anchor="middle", style="s")
        for at in y_ticks:
            py = self.y(at)
            picture.line(self.x0, py, self.x1, py, GRID, 1)
            picture.text(self.x0 - 7, py + 5, label(at), anchor="end", style="s")
        picture.add(
            f'<rect x="{num(self.x0)}" y="{num(self.y1)}" width="{num(self.x1 - self.x0)}" height="{num(self.y0 - self.y1)}" '
            f'fill="none" stroke="{GREY}"/>'
        )
        picture.text(0.5 * (self.x0 + self.x1), self.y0 + 41, x_label, anchor="middle")
        picture.text(17, 0.5 * (self.y0 + self.y1), y_label, anchor="middle", turn=-90)

    def place(self, v, ends, pixels, log):
        a, b = ends
        if log:
            v, a, b = math.log10(v), math.log10(a), math.log10(b)
        return pixels[0] + (v - a) / (b - a) * (pixels[1] - pixels[0])

    def x(self, v):
        return self.place(v, self.rx, (self.x0, self.x1), self.log[0])

    def y(self, v):
        return self.place(v, self.ry, (self.y0, self.y1), self.log[1])

    def inside(self, v):
        return min(self.ry) <= v <= max(self.ry)

    def curve(self, points, color=BLUE, dash=None, width=2.2):
        """Draws a line; it ends where it leaves the panel."""
        run = []
        for a, b in points:
            if self.inside(b):
                run.append((self.x(a), self.y(b)))
            else:
                if len(run) > 1:
                    self.p.path(run, color, width, dash)
                run = []
        if len(run) > 1:
            self.p.path(run, color, width, dash)

    def level(self, v, color=GREY, dash="5 4", width=1.5):
        self.p.line(self.x0, self.y(v), self.x1, self.y(v), color, width, dash)

    def upright(self, v, color=GREY, dash="5 4", width=1.5):
        self.p.line(self.x(v), self.y0, self.x(v), self.y1, color, width, dash)

    def band(self, low, high, color):
        self.p.add(
            f'<rect x="{num(self.x0)}" y="{num(self.y(high))}" width="{num(self.x1 - self.x0)}" '
            f'height="{num(self.y(low) - self.y(high))}" fill="{color}" fill-opacity="0.14"/>'
        )

    def text(self, x, y, text, color=INK, anchor="start", style="s", dx=0, dy=0):
        self.p.text(self.x(x) + dx, self.y(y) + dy, text, color, anchor, style)

    def dot(self, x, y, color=INK, hollow=False):
        self.p.dot(self.x(x), self.y(y), color, hollow=hollow)


def span(a, b, n=240):
    return [a + (b - a) * k / n for k in range(n + 1)]


def log_span(a, b, n=160):
    return [a * (b / a) ** (k / n) for k in range(n + 1)]


def picture_ellipse():
    """Locus of the injection current over the direction of the voltage, at 2 A, saliency enlarged four times."""
    i = complex(I_D, 2.0)
    enlarged = 4
    s = enlarged * tensor(i, 1)
    p = Picture("theory-ellipse", "Injection current over the direction of the injected voltage: an ellipse, with the phasors of one direction")
    p.height = 476
    x0, y0, unit = 228, 236, 128
    at = lambda z: (x0 + unit * z.real, y0 - unit * z.imag)
    circle = [at(cmath.exp(1j * a)) for a in span(0, TAU, 180)]
    ellipse = [at(cmath.exp(1j * a) + s * cmath.exp(-1j * a)) for a in span(0, TAU, 180)]
    p.line(24, y0, 452, y0, GREY, 1.2, arrow=True)
    p.line(x0, 416, x0, 12, GREY, 1.2, arrow=True)
    p.text(452, y0 - 9, "d: rotor flux φ (e = 0)", GREY, "end", "s")
    p.text(x0 + 8, 24, "q: injection axis θ = φ̂ + 90°", GREY, style="s")
    p.path(circle, GREY, 1.5, "3 4")
    p.path(ellipse, BLUE, 2.4)
    # axis of the lower inductance
    axis = cmath.exp(0.5j * cmath.phase(s))
    a, b = at(-axis * 1.55), at(axis * 1.55)
    p.line(*a, *b, GREEN, 1.4, "7 4")
    p.text(a[0] + 9, a[1] - 2, "axis of the lower inductance, arg(s)/2", GREEN, style="s")
    # stator current
    direction = cmath.exp(1j * cmath.phase(i)) * 1.18
    p.line(*at(0), *at(direction), PURPLE, 2.4, arrow=True)
    p.text(at(direction)[0] + 7, at(direction)[1] + 12, "stator current, γ", PURPLE, style="s")
    # voltage and current of the injection
    current = 1j + s * -1j
    p.line(*at(0), *at(1j), ORANGE, 2.4, arrow=True)
    p.text(at(1j)[0] - 8, at(1j)[1] + 34, "voltage", ORANGE, "end", "s")
    p.line(*at(0), *at(current), BLUE, 2.6, arrow=True)
    x, y = at(current)
    p.line(x0, y, x, y, INK, 1.4, "3 3")
    p.text(x0 - 8, y - 6, "along: 1 − Re s", INK, "end", "s")
    p.text(x + 30, y - 3, "across: −Im s", INK, style="s")
    p.text(at(-0.92 + 0.33j)[0] - 6, at(0.33j)[1], "no saliency", GREY, "end", "s")
    p.text(132, 330, "injection current,", BLUE, "end", "s")
    p.text(132, 347, "all directions", BLUE, "end", "s")
    p.text(24, 462, f"i_d = {I_D} A, i_q = 2 A; saliency drawn {enlarged} times as large", GREY, style="s")
    return p


def picture_q():
    p = Picture("theory-q", "Signal q over the angle error at 2 A: fast error, lasting error and flux not yet settled, their slopes and zeros")
    i_q = 2.0
    gamma = math.atan2(i_q, I_D)
    v = p.panel((-90, 90), (-0.08, 0.2), range(-90, 91, 30), [-0.05, 0, 0.05, 0.1, 0.15, 0.2], "angle error e (° electrical)", "signal q", 300)
    ref = q_slow(I_D, i_q, 0)
    v.level(ref)
    v.text(-88, ref, "q_ref", GREY, dy=16)
    low = gamma * DEG - 90
    fast = [(e, q_fast(I_D, i_q, e / DEG)) for e in span(-90, 90)]
    settled = [(e, q_slow(I_D, i_q, e / DEG)) for e in span(low, 90)]
    fixed = [(e, q_slow(I_D, i_q, e / DEG, follows=False)) for e in span(-90, 90)]
    v.curve(fixed, GREEN, "6 4", 1.8)
    v.curve(fast, ORANGE)
    v.curve(settled, BLUE, width=2.6)
    for k, left, right in [(slope(q_fast, i_q), -45, 20), (slope(q_slow, i_q), -42, 52)]:
        v.curve([(e, ref + k * e / DEG) for e in (left, right)], INK, "2 3", 1.6)
    v.text(-38, 0.163, f"k_fast = {label(slope(q_fast, i_q), 3)} /rad")
    v.text(89, -0.033, f"k = {label(slope(q_slow, i_q), 3)} /rad", anchor="end")
    v.dot(0, ref)
    for zero in zeros(lambda e: q_fast(I_D, i_q, e) - ref, -1.5, -0.3):
        v.dot(zero * DEG, ref, ORANGE, hollow=True)
    v.dot(low, q_slow(I_D, i_q, low / DEG), BLUE, hollow=True)
    for zero in zeros(lambda e: restoring(i_q, e), 0.8, 1.57):
        v.dot(zero * DEG, ref, BLUE, hollow=True)
    v.text(-88, 0.137, "fast error", ORANGE)
    v.text(89, -0.057, "lasting error", BLUE, "end")
    v.text(89, 0.06, "flux not yet settled", GREEN, "end")
    v.text(low, 0.03, "flux gone", BLUE, "end", dx=-2, dy=10)
    return p


def picture_sensitivity():
    p = Picture("theory-sensitivity", "Saliency sensitivity over the q-axis current, for a lasting and for a fast error")
    v = p.panel((0, 3), (-0.26, 0.02), [0, 0.5, 1, 1.5, 2, 2.5, 3], [-0.25, -0.2, -0.15, -0.1, -0.05, 0], "q-axis current (A)", "k = dq/de (1/rad)", 230, left=80)
    xs = span(0, 3, 120)
    v.curve([(x, slope(q_slow, x)) for x in xs], BLUE, width=2.6)
    v.curve([(x, slope(q_fast, x)) for x in xs], ORANGE)
    v.level(2 * A_PSI)
    v.text(2.97, 2 * A_PSI, "2a", GREY, "end", dy=17)
    v.text(2.97, -0.068, "lasting error", BLUE, "end", dy=-10)
    v.text(1.62, -0.14, "fast error", ORANGE)
    v.upright(I_D)
    v.text(I_D, -0.235, "i_q = i_d", GREY, dx=5)
    return p


def picture_false_lock():
    p = Picture("theory-false-lock", "Restoring signal of a lasting error, and torque of a frame that is fixed")
    v = p.panel((-60, 30), (-2.5, 2.5), range(-60, 31, 15), [-2, -1, 0, 1, 2], "angle error e (° electrical)", "q − q_ref (%)", 250, title="Restoring signal, flux settled")
    width = 100 * mismatch(0.01)
    v.band(-width, width, RED)
    
    for i_q, color, dash in [(0.5, GREEN, None), (1.0, BLUE, None), (2.0, ORANGE, None), (3.0, PURPLE, "7 3")]:
        low = math.atan2(i_q, I_D) * DEG - 90
        v.curve([(e, 100 * restoring(i_q, e / DEG)) for e in span(low, 30, 300)], color, dash)
        v.dot(low, 100 * restoring(i_q, low / DEG), color, hollow=True)
        peak, at = barrier(i_q)
        names = {0.5: (at * DEG, -2, "middle", -8), 1.0: (at * DEG, -14, "end", -1), 2.0: (at * DEG, -6, "end", -7), 3.0: (at * DEG, 8, "start", -16)}
        x, dx, anchor, dy = names[i_q]
        v.text(x, 100 * peak, f"{label(i_q)} A", color, anchor, dx=dx, dy=dy)
    v.dot(0, 0)
    v.text(29, 0, "gain mismatch", RED, "end", dy=-9)
    v.text(29, 0, "of 1 %", RED, "end", dy=9)
    v = p.panel((-350, 50), (-0.2, 1.2), range(-350, 51, 100), [0, 0.4, 0.8, 1.2], "shaft speed (rpm)", "torque (Nm)", 230, title="Torque of a frame that is fixed, i_q = 2 A")
    v.curve([(n, fixed_frame(2.0, n)[1]) for n in span(-350, 50, 400)], BLUE, width=2.6)
    v.level(0, GREY, None, 1)
    n = lock_rpm(2.0)
    v.dot(n, fixed_frame(2.0, n)[1])
    v.text(n, fixed_frame(2.0, n)[1], "true lock", INK, "start", dx=10, dy=12)
    t = fixed_frame(2.0, -150)[1]
    v.dot(-150, t, RED)
    v.text(-150, t, "false lock", RED, "end", dx=-8, dy=-8)
    v.text(-345, 0.94, "a load that drives the shaft faster", GREY)
    v.text(-345, 0.94, "meets less torque", GREY, dy=17)
    return p


def picture_observability():
    p = Picture("theory-observability", "Fluxes that the same voltage and current allow at zero stator frequency, and the angle error of a flux from the voltage")
    p.height = 330
    p.text(64, 22, "Zero stator frequency: one voltage, many fluxes", style="b")
    i = complex(I_D, 2.0)
    x0, y0, unit = 168, 278, 76
    at = lambda z: (x0 + unit * z.real, y0 - unit * z.imag)
    p.line(24, y0, 462, y0, GREY, 1.2, arrow=True)
    p.line(x0, 318, x0, 34, GREY, 1.2, arrow=True)
    p.text(462, y0 + 40, "along the frame (ψ / L_M i_d)", GREY, "end", "s")
    scale = 1 / I_D
    locus = [at(scale * i / (1 - 1j * x)) for x in [math.tan(a) for a in span(-1.5707, 1.5707, 240)]]
    p.path(locus, BLUE, 2.4)
    top = at(scale * i * 0.78)
    p.line(*at(0), *top, PURPLE, 2.2, arrow=True)
    p.text(top[0] + 8, top[1] + 4, "current", PURPLE, style="s")
    for rpm, name, dx, dy, anchor, color in [
        (lock_rpm(2.0), f"{label(lock_rpm(2.0), 0)} rpm: true lock", 9, -9, "start", INK),
        (-150, "−150 rpm", -4, 24, "start", RED),
        (-300, "−300 rpm", -8, 24, "end", RED),
        (-25, "−25 rpm", 10, 4, "start", BLUE),
        (25, "25 rpm", -9, 4, "end", BLUE),
    ]:
        psi = fixed_frame(2.0, rpm)[0]
        x, y = at(psi)
        p.dot(x, y, color)
        p.text(x + dx, y + dy, name, color, anchor, "s")
    v = p.panel((0.1, 30), (0.5, 200), [0.1, 0.3, 1, 3, 10, 30], [0.5, 1, 3, 10, 30, 100], "stator frequency (Hz)", "angle error (°)", 240, (True, True), title="Flux from the voltage, i_q = 1 A")
    hz = log_span(0.1, 30)
    v.curve([(f, voltage_error(f, 0.1 * M.r_s)) for f in hz], BLUE, width=2.6)
    v.curve([(f, voltage_error(f, 0.01 * M.r_s)) for f in hz], BLUE, "6 4")
    v.curve([(f, voltage_error(f, d_volt=RESIDUAL)) for f in hz], ORANGE, width=2.6)
    v.level(1.4, GREEN, None, 2)
    v.upright(16, GREY)
    v.text(16, 0.5, "16 Hz", GREY, "end", dx=-4, dy=-7)
    v.text(7.5, 38, f"{cell(RESIDUAL, 1)} V", ORANGE)
    v.text(0.62, 21, "r_s + 10 %", BLUE)
    v.text(0.12, 4, "r_s + 1 %", BLUE)
    v.text(0.11, 1.4, "injection, rms", GREEN, dy=-6)
    return p


def leak(i_q, x):
    """Current difference of the printed chain, mA, over x = φ − θ in rad, Eq. S8."""
    g = abs(response(sections(FILTERS, "BPF"), 0))
    i = complex(I_D, i_q)
    return -1e3 * math.sqrt(2) * g * abs(i) * math.sin(x + cmath.phase(i))


def picture_leak():
    p = Picture("theory-leak", "Current difference of the printed chain over the injection angle: the fundamental that leaks through the band-pass")
    v = p.panel((-180, 180), (-50, 50), range(-180, 181, 60), [-40, -20, 0, 20, 40], "φ − θ (° electrical)", "Δi (mA)", 280)
    v.level(10)
    v.level(-10)
    v.upright(-90, GREY)
    for i_q, color, dash in [(0.0, GREEN, None), (1.0, BLUE, None), (2.0, ORANGE, None), (3.0, PURPLE, "7 3")]:
        v.curve([(x, leak(i_q, x / DEG)) for x in span(-180, 180)], color, dash)
        v.dot(-math.atan2(i_q, I_D) * DEG, 0, color, hollow=True)
    v.dot(-90, leak(1.0, -math.pi / 2))
    for n, (name, color) in enumerate([("i_q = 0", GREEN), ("1 A", BLUE), ("2 A", ORANGE), ("3 A", PURPLE)]):
        v.text(-174, -16, name, color, dy=17 * n)
    v.text(-50, 10, "printed: 10 mA", GREY, dy=-6)
    v.text(-84, 42, "φ − θ = −90°: the drive's angle", GREY)
    return p


def picture_resistance():
    p = Picture("theory-resistance", "Flux angle error and torque over the error of the rotor resistance, with the encoder")
    v = p.panel((0.5, 2), (-20, 20), [0.5, 0.75, 1, 1.25, 1.5, 1.75, 2], [-20, -10, 0, 10, 20], "true over assumed rotor resistance", "angle error e (°)", 240)
    series = [(0.35, GREEN, None), (0.7, BLUE, None), (1.5, ORANGE, None), (3.0, PURPLE, "7 3")]
    for i_q, color, dash in series:
        v.curve([(x, flux_angle(i_q, x)[0] * DEG) for x in span(0.5, 2)], color, dash)
    v.level(0, GREY, None, 1)
    v.upright(1.3)
    v.text(1.3, -20, "30 % warmer", GREY, dx=5, dy=-8)
    for n, (i_q, color, _) in enumerate(series):
        v.text(0.52, 20, ("i_q = " if n == 0 else "") + f"{label(i_q)} A", color, dy=18 + 17 * n)
    v = p.panel((0.5, 2), (0.4, 1.8), [0.5, 0.75, 1, 1.25, 1.5, 1.75, 2], [0.4, 0.8, 1.2, 1.6], "true over assumed rotor resistance", "torque / expected", 220)
    for i_q, color, dash in series:
        v.curve([(x, torque_share(i_q, x)) for x in span(0.5, 2)], color, dash)
    v.level(1, GREY, None, 1)
    v.upright(1.3)
    return p


def picture_noise():
    p = Picture("theory-noise", "Angle error that the noise of the current sensors causes, over the bandwidth of the loop")
    v = p.panel((1, 10), (0, 6), range(1, 11), range(0, 7), "bandwidth of the loop without observer (Hz)", "angle error, rms (°)", 260)
    hz = span(1, 10, 18)
    filters = [(f, Filter(1.0, 0.0, observer=False, hz=f)) for f in hz]
    base = [(f, x.noise_deg()) for f, x in filters]
    for share, name, color, dash in [(2, "10 mA", PURPLE, "7 3"), (1, "5 mA", BLUE, None), (0.5, "2.5 mA", GREEN, None)]:
        line = [(f, share * y) for f, y in base]
        v.curve(line, color, dash, 2.6)
    at = dict((n, y) for n, (_, y) in enumerate(base))
    v.text(hz[4], 2 * at[4], "10 mA", PURPLE, "end", dx=-8, dy=-8)
    v.text(hz[13], at[13], "5 mA", BLUE, "end", dx=-8, dy=-6)
    v.text(hz[15], 0.5 * at[15], "2.5 mA", GREEN, "end", dx=-2, dy=-9)
    y = NUMBERS["noise_1a_deg"]
    v.dot(3.5, base_at(base, 3.5), BLUE)
    v.text(3.5, base_at(base, 3.5), "3.5 Hz: default", BLUE, dx=9, dy=14)
    v.level(y, ORANGE, "5 4", 2)
    v.text(9.9, y, "filter with the observer, 5 mA", ORANGE, "end", dy=17)
    return p


def base_at(points, x):
    for (a, fa), (b, fb) in zip(points, points[1:]):
        if a <= x <= b:
            return fa + (fb - fa) * (x - a) / (b - a)
    return points[-1][1]


def picture_loop():
    p = Picture("theory-loop", "Open loop of the angle: magnitude and phase over frequency")
    loops = [
        (Filter(1.0, 0.0), BLUE, None, "1 A, shaft locked"),
        (Filter(3.0, -3.0 / (I_D * M.tau)), ORANGE, "7 3", "3 A, zero stator frequency"),
    ]
    hz = log_span(0.3, 60, 120)
    ticks = [0.3, 1, 3, 10, 30]
    v = p.panel((0.3, 60), (0.03, 30), ticks, [0.1, 1, 10], "frequency (Hz)", "open loop, magnitude", 220, (True, True))
    values = [[loop.loop(f) for f in hz] for loop, *_ in loops]
    for line, (_, color, dash, name) in zip(values, loops):
        v.curve([(f, abs(x)) for f, x in zip(hz, line)], color, dash, 2.6)
    v.level(1, GREY, None, 1.2)
    v.text(58, 30, loops[0][3], BLUE, "end", dy=20)
    v.text(58, 30, loops[1][3], ORANGE, "end", dy=37)
    w = p.panel((0.3, 60), (-360, 0), ticks, [-360, -270, -180, -90, 0], "frequency (Hz)", "open loop, phase (°)", 220, (True, False))
    for line, (loop, color, dash, _) in zip(values, loops):
        phases, last = [], None
        for x in line:
            phase = cmath.phase(x) * DEG
            if last is None:
                phase -= 360 if phase > 30 else 0
            else:
                while phase - last > 180:
                    phase -= 360
                while phase - last < -180:
                    phase += 360
            last = phase
            phases.append(phase)
        w.curve(list(zip(hz, phases)), color, dash, 2.6)
        crossover, margin = loop.margins()[:2]
        w.dot(crossover, margin - 180, color)
    w.level(-180, RED, None, 1.4)
    w.text(0.32, -180, "−180°", RED, dy=17)
    w.text(0.32, -340, "points: crossover, phase margin above the red line", GREY)
    return p


# --------------------------------------------------------------------------------------------------------------------- tables, numbers

OFFSET_CURRENTS = [0.0, 0.5, 1.0, 1.5, 2.0, 3.0]


def picture_torque_map():
    """Largest torque over the speed, both in percent of the rated values, from the files in results/."""
    plate = tomllib.loads(source("motors/motulator-2kw2.toml"))
    rated, pairs = plate["nameplate"]["speed_rpm"], plate["motor"]["pole_pairs"]
    percent = lambda hz: 100 * 60 * hz / pairs / rated
    rows = json.loads(source("results/torque-map.json"))["rows"]
    p = Picture("torque-map", "Largest torque over the speed in percent of the rated values, motoring and generating")
    v = p.panel((0, 250), (-170, 170), [0, 50, 100, 150, 200, 250], [-150, -100, -50, 0, 50, 100, 150], "speed (% of rated)", "torque (% of rated)", 330)
    for low, high, color in [(0, percent(16), GREY), (percent(16), percent(26), "#afb8c1")]:
        p.add(f'<rect x="{num(v.x(low))}" y="{num(v.y1)}" width="{num(v.x(high) - v.x(low))}" height="{num(v.y0 - v.y1)}" fill="{color}" fill-opacity="0.16"/>')
    v.level(0, dash=None, width=1)
    v.curve([(100 * rpm / rated, nm) for rpm, nm, _ in rows], BLUE, width=2.8)
    v.curve([(100 * rpm / rated, -nm) for rpm, _, nm in rows], ORANGE, width=2.8)
    envelope = json.loads(source("results/torque-envelope.json"))["rows"]
    of = lambda rpm, nm: (100 * rpm / M.rated_rpm, 100 * nm / M.rated_nm)
    for column, sign in [(3, 1), (6, -1)]:
        v.curve([of(row[0], sign * row[column]) for row in envelope], GREEN, "6 4", 2)
    v.text(0, -95, "injection", GREY, dx=6, dy=5)
    v.text(percent(16), -72, "back-EMF observer", GREY, dx=6, dy=5)
    v.text(100, 150, "motoring", BLUE, dx=-14, dy=0)
    v.text(120, -143, "generating", ORANGE, dx=8, dy=4)
    v.text(162, 84, "field weakening", GREY)
    v.text(52, 32, "dissertation's motor", GREEN, dx=4, dy=-8)
    return p


def picture_system():
    """From the mains to the shaft, and the drive between the current sensors and the gates."""
    p = Picture("system", "From the mains to the shaft: rectifier, dc link, inverter, motor; below, the drive with its two sources of the flux angle")
    p.height = 372
    box = p.box
    p.text(8, 50, "mains", GREY, style="s")
    p.line(8, 60, 46, 60, GREY, 1.5, arrow=True)
    box(48, 34, 82, 52, ["rectifier"], GREY)
    p.line(130, 60, 158, 60, GREY, 1.5, arrow=True)
    box(160, 34, 74, 52, ["dc link"], GREY)
    p.line(234, 60, 262, 60, GREY, 1.5, arrow=True)
    box(264, 34, 82, 52, ["inverter"], GREY)
    p.line(346, 60, 386, 60, GREY, 1.5, arrow=True)
    p.add(f'<circle cx="416" cy="60" r="28" fill="{GREY}" fill-opacity="0.08" stroke="{GREY}" stroke-width="1.6"/>')
    p.text(416, 65, "motor", GREY, "middle")
    p.line(444, 60, 476, 60, GREY, 5)
    p.text(474, 48, "shaft", GREY, "end", "s")
    p.add(f'<rect x="8" y="128" width="464" height="234" rx="5" fill="none" stroke="{INK}" stroke-width="1.6" stroke-dasharray="6 4"/>')
    p.text(20, 151, "the drive: STM32G474, 6 kHz", INK, style="b")
    p.line(305, 168, 305, 88, BLUE, 1.8, arrow=True)
    p.text(299, 112, "duties", BLUE, "end", "s")
    p.line(366, 60, 366, 208, BLUE, 1.8)
    p.line(366, 208, 366, 226, BLUE, 1.8)
    p.text(372, 112, "phase currents", BLUE, style="s")
    box(196, 168, 150, 56, ["current control", "i_d flux, i_q torque"], BLUE)
    box(20, 168, 130, 56, ["references", "torque or speed"], GREY)
    p.line(150, 196, 194, 196, GREY, 1.5, arrow=True)
    p.line(366, 196, 348, 196, BLUE, 1.8, arrow=True)
    box(20, 244, 130, 84, ["injection", "600 Hz, across the", "estimated flux"], ORANGE)
    p.line(150, 262, 224, 262, ORANGE, 1.8)
    p.line(224, 262, 224, 226, ORANGE, 1.8, arrow=True)
    box(240, 244, 222, 44, ["demodulation of the injection", "standstill, low speed"], ORANGE)
    box(240, 300, 222, 44, ["back-EMF observer", "from 16 Hz"], GREEN)
    p.line(366, 226, 366, 242, BLUE, 1.8, arrow=True)
    p.line(240, 322, 190, 322, INK, 1.8)
    p.line(240, 270, 190, 270, INK, 1.8)
    p.line(190, 322, 190, 276, INK, 1.8)
    p.line(190, 276, 190, 216, INK, 1.8)
    p.line(190, 216, 195, 216, INK, 1.8, arrow=True)
    p.text(156, 346, "flux angle φ", INK, style="s")
    return p


def picture_source_vectors():
    """Figures 7 and 8: the injection along the flux and off it, and the current's parts along dm and qm."""
    p = Picture("source-vectors", "Figures 7 and 8: the current of an injection along the flux has equal parts along dm and qm; off the flux it has not")
    p.height = 290
    share, unit = 0.3, 100
    for x0, off, name in [(104, 0, "along the flux: equal parts"), (322, -25, "25° off: unequal parts")]:
        y0, flux = 196, math.radians(62)
        at = lambda z: (x0 + unit * z.real, y0 - unit * z.imag)
        theta = flux + math.radians(off)
        x = flux - theta
        # (S2) in the frame of the injection axis
        y_d, y_q = 1 - share, 1 + share
        i = complex(y_d * math.cos(x) ** 2 + y_q * math.sin(x) ** 2, (y_d - y_q) * math.sin(x) * math.cos(x)) * cmath.exp(1j * theta)
        p.line(*at(0), *at(1.5 * cmath.exp(1j * flux)), GREY, 1.3, "7 4", arrow=True)
        p.text(*at(1.56 * cmath.exp(1j * flux)), "flux, φ", GREY, "middle" if off else "end", "s")
        for name_axis, turn in [("dm", -45), ("qm", 45)]:
            axis = cmath.exp(1j * (theta + math.radians(turn)))
            p.line(*at(0), *at(1.3 * axis), INK, 1.1, "3 3")
            p.text(at(1.36 * axis)[0], at(1.36 * axis)[1] + 5, name_axis, INK, "middle", "s")
            part = (i * axis.conjugate()).real
            p.line(*at(i), *at(part * axis), BLUE, 1.1, "3 3")
            p.line(*at(0), *at(part * axis), GREEN, 4)
        p.line(*at(0), *at(1.22 * cmath.exp(1j * theta)), ORANGE, 2.2, arrow=True)
        p.text(at(1.3 * cmath.exp(1j * theta))[0] + 6, at(1.3 * cmath.exp(1j * theta))[1] + 8, "v, θ", ORANGE, style="s")
        p.line(*at(0), *at(i), BLUE, 2.6, arrow=True)
        p.text(x0 + 14, 236, name, INK, "middle")
    p.text(10, 262, "orange: injected voltage; blue: its current, with a saliency of 30 %;", GREY, style="s")
    p.text(10, 280, "green: the parts of the current along dm and qm", GREY, style="s")
    return p


def picture_source_schemes():
    """Figures 9 and 20: the schemes of Ha and Sul and of the dissertation."""
    p = Picture("source-schemes", "Figures 9 and 20: where the injection enters, how the currents are filtered, and where the angle comes from, in the scheme of Ha and Sul and in the dissertation's")
    p.height = 482
    for y, name, forward, sum_after, low, high, out in [
        (0, "Figure 9: Ha and Sul, injection along the flux", [("PI", 42), ("e^jφ̂", 52), ("SVM", 52), ("motor", 62)], 0, [("e^−jφ̂", 62), ("F1", 40)], [("e^−j(φ̂−45°)", 104), ("F2", 40), ("rms(v)/rms(i), F3, PII", 164)], "φ̂"),
        (242, "Figure 20: the dissertation, injection across the flux", [("PI", 42), ("e^jφ̂", 52), ("SVM", 52), ("motor", 62)], 1, [("LPF", 46), ("e^−jφ̂", 62)], [("BPF", 46), ("e^−j(θ−45°), Re − Im", 168), ("PP", 40), ("PII", 42)], "θ, and φ̂ = θ − 90°"),
    ]:
        p.text(10, y + 22, name, INK, style="b")
        p.text(8, y + 62, "i_ref", GREY, style="s")
        p.line(38, y + 67, 56, y + 67, GREY, 1.6, arrow=True)
        p.sum(66, y + 67)
        p.line(75, y + 67, 91, y + 67, BLUE, 1.6, arrow=True)
        x = 92
        for n, (block, w) in enumerate(forward):
            p.box(x, y + 50, w, 34, [block], BLUE)
            x += w
            if n == sum_after:
                p.line(x, y + 67, x + 16, y + 67, BLUE, 1.6, arrow=True)
                p.sum(x + 26, y + 67, ORANGE)
                p.line(x + 26, y + 40, x + 26, y + 57, ORANGE, 1.6, arrow=True)
                p.text(x + 38, y + 42, "v cos Ωt" if n == 0 else "v cos Ωt e^jθ", ORANGE, style="s")
                x += 35
            if n < len(forward) - 1:
                p.line(x, y + 67, x + 16, y + 67, BLUE, 1.6, arrow=True)
                x += 17
        p.line(x, y + 67, x + 16, y + 67, BLUE, 1.6)
        p.line(x + 16, y + 67, x + 16, y + 187, BLUE, 1.6)
        p.text(x + 22, y + 100, "i_αβ", BLUE, style="s")
        p.line(x + 16, y + 127, 300, y + 127, BLUE, 1.6, arrow=True)
        end = p.chain(299, y + 110, low, BLUE, back=True)
        p.line(end, y + 127, 66, y + 127, BLUE, 1.6)
        p.line(66, y + 127, 66, y + 77, BLUE, 1.6, arrow=True)
        p.text(74, y + 92, "−", BLUE)
        p.line(x + 16, y + 187, 385, y + 187, ORANGE, 1.6, arrow=True)
        end = p.chain(384, y + 170, high, ORANGE, back=True)
        p.line(end, y + 187, end - 16, y + 187, ORANGE, 1.6, arrow=True)
        p.text(10, y + 226, f"the last block gives {out}", ORANGE, style="s")
    return p


def picture_source_angle_loop():
    """Figures 33 and 34: the chain that the PII closes, and its replacement by one transfer function."""
    p = Picture("source-angle-loop", "Figures 33 and 34: PII, modulator, motor, band-pass, rotation, difference and post-processing filter in a loop; below, all but the PII as one transfer function of two poles")
    p.height = 316
    p.text(10, 22, "Figure 33: the loop of the injection", INK, style="b")
    p.add(f'<rect x="140" y="34" width="332" height="122" rx="5" fill="{GREY}" fill-opacity="0.10" stroke="{GREY}" stroke-dasharray="6 4"/>')
    p.text(464, 52, "φ(z)", GREY, "end")
    p.chain(74, 62, [("PII", 46), ("SVM, v cos Ωt e^jθ", 150), ("motor", 62)], ORANGE, 36)
    p.text(126, 58, "θ", ORANGE, style="s")
    p.line(402, 96, 402, 114, ORANGE, 1.6, arrow=True)
    end = p.chain(466, 116, [("BPF", 110), ("Re − Im", 76), ("PP", 50)], ORANGE, 17, back=True)
    p.line(end, 133, 44, 133, ORANGE, 1.6)
    p.text(60, 128, "Δi", ORANGE, style="s")
    p.line(44, 133, 44, 89, ORANGE, 1.6, arrow=True)
    p.sum(44, 79, ORANGE)
    p.text(30, 103, "−", ORANGE, "end")
    p.line(53, 79, 72, 79, ORANGE, 1.6, arrow=True)
    p.line(8, 79, 34, 79, GREY, 1.6, arrow=True)
    p.text(4, 66, "10 mA", GREY, style="s")
    p.text(10, 198, "Figure 34: the same with (3.43) in its place", INK, style="b")
    p.line(8, 245, 34, 245, GREY, 1.6, arrow=True)
    p.text(4, 232, "10 mA", GREY, style="s")
    p.sum(44, 245, ORANGE)
    p.line(53, 245, 72, 245, ORANGE, 1.6, arrow=True)
    p.chain(74, 228, [("PII", 46)], ORANGE)
    p.line(120, 245, 154, 245, ORANGE, 1.6, arrow=True)
    p.text(128, 238, "θ", ORANGE, style="s")
    p.sum(164, 245, ORANGE)
    p.line(164, 218, 164, 235, GREY, 1.6, arrow=True)
    p.text(172, 222, "angle of the flux", GREY, style="s")
    p.text(150, 264, "−", ORANGE)
    p.line(173, 245, 206, 245, ORANGE, 1.6, arrow=True)
    p.box(208, 226, 190, 38, ["φ = k / ((z − p₁)(z − p₂))"], GREY)
    p.line(398, 245, 440, 245, ORANGE, 1.6)
    p.text(410, 238, "Δi", ORANGE, style="s")
    p.line(440, 245, 440, 290, ORANGE, 1.6)
    p.line(440, 290, 44, 290, ORANGE, 1.6)
    p.line(44, 290, 44, 255, ORANGE, 1.6, arrow=True)
    p.text(30, 270, "−", ORANGE, "end")
    return p


def cell(x, digits):
    text = f"{x:.{digits}f}"
    if float(text) == 0:
        text = text.removeprefix("-")
    return text.replace("-", "−")


def table(heads, rows):
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def second_zeros(i_q):
    """Second zeros, degrees: fast, flux not yet settled, flux gone (no zero, but the end of the curve), lasting."""
    ref = q_slow(I_D, i_q, 0)
    gamma = math.atan2(i_q, I_D)
    near = lambda found: [z * DEG for z in found if abs(z) > 0.02]
    fast = near(zeros(lambda e: q_fast(I_D, i_q, e) - ref, -math.pi / 2, math.pi / 2 - 1e-6))
    fixed = near(zeros(lambda e: q_slow(I_D, i_q, e, False) - ref, -1.75, 1.75))
    settled = near(zeros(lambda e: restoring(i_q, e), gamma - math.pi / 2 + 1e-4, min(gamma + math.pi / 2, 1.75) - 1e-4))
    return fast, fixed, gamma * DEG - 90, settled


def block_motor():
    x = OMEGA * M.sigma_ls
    return table(
        ["quantity", "equation", "value"],
        [
            ["total leakage factor σ", "T3", cell(M.sigma, 4)],
            ["transient inductance σL_s", "T3", f"{cell(1e3 * M.sigma_ls, 2)} mH"],
            ["coupling k_r = L_m/L_r", "T3", cell(M.k_r, 4)],
            ["L_M = k_r L_m", "T4", f"{cell(1e3 * M.coupled, 2)} mH"],
            ["R_R = k_r² r_r", "T4", f"{cell(M.r_rotor, 3)} Ω"],
            ["rotor time constant τ_r = 1/α", "T4", f"{cell(M.tau, 4)} s, α = {cell(M.alpha, 2)} /s"],
            ["flux ψ = L_M i_d at 0.7 A", "T8", f"{cell(M.coupled * I_D, 4)} Wb"],
            ["torque per ampere at 0.7 A", "T6", f"{cell(M.torque(I_D, 1), 3)} Nm/A"],
            ["slip per ampere at 0.7 A, 1/(τ_r i_d)", "T9", f"{cell(1 / (M.tau * I_D), 2)} rad/s, {cell(1 / (M.tau * I_D) / TAU, 2)} Hz"],
            ["reactance Ω σL_s at 600 Hz", "T13", f"{cell(x, 1)} Ω"],
            ["injection current v/(Ω σL_s) at 50 V", "T13", f"{cell(V_INJ / x, 3)} A"],
            ["its torque ripple along the q axis, peak", "T6", f"{cell(M.torque(I_D, V_INJ / x), 3)} Nm"],
        ],
    )


def block_offset():
    rows = []
    for i_q in OFFSET_CURRENTS:
        s = tensor(complex(I_D, i_q), 1)
        lasting, fast = slope(q_slow, i_q), slope(q_fast, i_q)
        rows.append(
            [cell(i_q, 1), cell(math.atan2(i_q, I_D) * DEG, 1), cell(s.real, 4), cell(s.imag, 4), cell(signal(s), 4), cell(lasting, 4), cell(slope(q_slow, i_q, follows=False), 4), cell(fast, 4), cell(fast / lasting, 2)]
        )
    return table(["i_q, A", "γ, °", "Re s", "Im s", "q_ref", "k lasting, 1/rad", "k flux not yet settled, 1/rad", "k fast, 1/rad", "fast / lasting"], rows)


def block_zeros():
    rows = []
    join = lambda found: ", ".join(cell(z, 1) for z in found) or "–"
    for i_q in OFFSET_CURRENTS[1:]:
        fast, fixed, gone, settled = second_zeros(i_q)
        rows.append([cell(i_q, 1), join(fast), join(fixed), cell(gone, 1), join(settled)])
    return table(["i_q, A", "fast", "flux not yet settled", "flux gone, γ − 90°", "lasting"], rows)


def block_barrier():
    rows = []
    for i_q in OFFSET_CURRENTS[1:]:
        peak, at = barrier(i_q)
        gamma = math.atan2(i_q, I_D)
        flux = math.cos(gamma - at) / math.cos(gamma)
        rows.append([cell(i_q, 1), cell(100 * peak, 2), cell(at * DEG, 1), cell(flux, 2), cell(peak / mismatch(0.01), 2)])
    return table(["i_q, A", "barrier, %", "at e, °", "flux there, of nominal", "gain mismatch of this size, %"], rows)


def flux_share(gamma, e):
    """f of Eq. T19, with the flux settled."""
    r = (math.cos(gamma - e) / math.cos(gamma)) ** 2
    return 2 * r / (1 + r)


def deficit(i_q, e):
    """Saliency deficit 1 − f cos 2e of a saliency that is fixed to the flux."""
    return 1 - flux_share(math.atan2(i_q, I_D), e) * math.cos(2 * e)


def block_false():
    rows = []
    true = lock_rpm(2.0)
    for rpm, name in [(true, "true lock"), (-100.0, ""), (-150.0, ""), (-300.0, "")]:
        flux, torque, e = fixed_frame(2.0, rpm)
        need = abs(restoring(2.0, e))
        need = 0.0 if need < 1e-6 else need
        hidden = math.sqrt(max(0.0, mismatch(0.01) ** 2 - need**2)) / abs(A_PSI)
        rows.append(
            [
                cell(rpm, 0) + (f" ({name})" if name else ""),
                cell(abs(flux), 2),
                cell(0 if abs(e) < 1e-9 else e * DEG, 1),
                cell(torque, 2),
                cell(100 * need, 2),
                cell(need / mismatch(0.01), 2),
                cell(deficit(2.0, e), 2),
                cell(deficit(2.0, e) - hidden, 2),
            ]
        )
    heads = ["shaft, rpm", "flux, of nominal", "e, °", "torque, Nm", "asymmetry that holds it, %", "as gain mismatch, %", "deficit 1 − f cos 2e", "least deficit shown at 1 % mismatch"]
    return table(heads, rows)


def shown(i_q, rpm, gain, full):
    """Deficit that the lock monitor computes in a false lock with this gain mismatch, Eq. T30.

    With `full` the sensors turn the injection current i of Eq. T13 into i + n i*, without an approximation, and k is that of Eq. T22.
    """
    i = complex(I_D, i_q)
    flux, _, e = fixed_frame(i_q, rpm)
    n, rho = mismatch(gain), restoring(i_q, e)
    if not full:
        return deficit(i_q, e) + math.sqrt(max(0.0, n * n - rho * rho)) / A_PSI
    s, s_ref = tensor(i, flux), tensor(i, 1)
    # q of the measured current is q_ref on the line Re n' x + Im n' y = -rho; of its two points with |n'| = n, that with Re n' < 0
    x, y = signal(s) + signal(s_ref), 1 - signal(s) * signal(s_ref)
    size = math.hypot(x, y)
    side = math.sqrt(max(0.0, n * n - (rho / size) ** 2)) / size
    seen = complex(-rho * x / size**2 - side * y, -rho * y / size**2 + side * x) if gain else 0
    along = lambda s: (1 - s.real) / (1 - abs(s) ** 2)
    measured = along(s) * (1 - seen.real + seen.imag * signal(s)) if gain else along(s)
    return (1 - (measured / along(s_ref)) ** 2) * -1 / slope(q_slow, i_q)


def trip_rpm(i_q, gain, full=False):
    """Shaft speed at which the deficit shown reaches the limit of the lock monitor."""
    limit = constant(SETTINGS, "allowed_deficit")
    rpm = lock_rpm(i_q)
    while shown(i_q, rpm, gain, full) <= limit:
        rpm -= 0.05
    return rpm


def never_trips(i_q):
    """Least gain mismatch with which the deficit shown in full stays below the limit when the flux has gone."""
    low, high = 0.0, 0.1
    for _ in range(40):
        g = 0.5 * (low + high)
        low, high = (g, high) if shown(i_q, -1e6, g, True) > constant(SETTINGS, "allowed_deficit") else (low, g)
    return high


def block_trip():
    rows = []
    for i_q, gain in [(1.0, 0.0), (2.0, 0.0), (2.0, 0.01), (3.0, 0.0), (3.0, 0.0065)]:
        row = [cell(i_q, 1), f"{100 * gain:g}"]
        for full in (False, True):
            rpm = trip_rpm(i_q, gain, full)
            row += [cell(rpm, 0), cell(abs(fixed_frame(i_q, rpm)[0]), 2)]
        rows.append(row)
    return table(["i_q, A", "gain mismatch, %", "trips at, rpm, first order", "flux there, of nominal", "trips at, rpm, in full", "flux there, of nominal"], rows)


def block_voltage():
    rows = []
    for f in [0.1, 0.5, 1.0, 2.0, 5.0, 12.0, 16.0]:
        rows.append([f"{f:g}", *(cell(x, 1) for x in (voltage_error(f, 0.01 * M.r_s), voltage_error(f, 0.1 * M.r_s), voltage_error(f, d_volt=RESIDUAL)))])
    return table(["stator frequency, Hz", "r_s off by 1 %, °", "r_s off by 10 %, °", f"{cell(RESIDUAL, 2)} V along the current, °"], rows)


def block_resistance():
    rows = []
    for share in [0.7, 0.8, 0.9, 1.1, 1.2, 1.3, 1.5]:
        row = [f"{share:g}"]
        for i_q in (0.35, 0.7, 1.5, 3.0):
            error, flux = flux_angle(i_q, share)
            row.append(f"{cell(error * DEG, 1)} / {cell(flux, 2)} / {cell(torque_share(i_q, share), 2)}")
        rows.append(row)
    return table(["true over assumed r_r", *(f"i_q = {i_q} A" for i_q in (0.35, 0.7, 1.5, 3.0))], rows)


def block_impedance():
    z_q = complex(M.r_s, OMEGA * M.sigma_ls)
    z_d = z_q + M.r_rotor
    y = abs(1 / z_q) - abs(1 / z_d)
    return table(
        ["quantity", "value"],
        [
            ["\\|Z_d\\| by Eq. 3.8", f"{cell(abs(z_d), 3)} Ω"],
            ["\\|Z_q\\| by Eq. 3.8", f"{cell(abs(z_q), 3)} Ω"],
            ["their difference", f"{cell(100 * (abs(z_d) / abs(z_q) - 1), 3)} %"],
            ["resistance against reactance, r_s/(Ω σL_s)", f"{cell(100 * M.r_s / (OMEGA * M.sigma_ls), 1)} %"],
            ["largest Δi by Eq. S4 with these, at 50 V", f"{cell(1e6 * V_INJ / math.sqrt(2) * y, 0)} µA"],
            ["largest Δi by Eq. S4 with 3.5 % of inductive saliency, at 50 V", f"{cell(1e3 * V_INJ / math.sqrt(2) * 2 * abs(A_PSI) / (OMEGA * M.sigma_ls), 1)} mA"],
        ],
    )


def block_leak():
    rows = []
    for i_q in [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0]:
        g = abs(response(sections(FILTERS, "BPF"), 0))
        rows.append([cell(i_q, 1), cell(leak(i_q, -math.pi / 2), 2), cell(math.atan2(i_q, I_D) * DEG, 1), cell(1e3 * math.sqrt(2) * g * i_q, 1)])
    return table(["i_q, A", "Δi at θ = φ + 90°, mA", "zero at θ − φ, °", "slope there, mA/rad"], rows)


def block_direct():
    rows = []
    for i_q in [0.0, 1.0, 1.5, 2.0, 3.0]:
        s = tensor(complex(I_D, i_q), 1)
        x = V_INJ / (OMEGA * M.sigma_ls * (1 - abs(s) ** 2))
        along_q, along_d, across = x * (1 - s.real), x * (1 + s.real), x * abs(s.imag)
        ripple = lambda i: M.torque(I_D, i)
        rows.append([cell(i_q, 1), cell(1e3 * along_q, 0), cell(1e3 * along_d, 0), cell(1e3 * across, 1), cell(1e3 * x * 2 * abs(A_PSI), 1), cell(ripple(along_q), 3), cell(ripple(across), 3)])
    heads = ["i_q, A", "along, injected on q, mA", "along, injected on d, mA", "across, either, mA", "change of it, mA/rad", "torque ripple, injected on q, Nm", "on d, Nm"]
    return table(heads, rows)


def block_chain():
    c = C_INJ
    period = WHITE * NOISE / c
    triangle = [min(k + 1, 39 - k) / 400 for k in range(39)]
    reading = math.sqrt(2 * SENSORS * sum(x * x for x in triangle)) * NOISE / c
    f = Filter(1.0, 0.0)
    k = 2 * abs(A_PSI)
    code = constant(ESTIMATOR, "AVERAGED_NOISE") * NOISE / c
    return table(
        ["step", "equation", "value"],
        [
            ["noise of a current sensor, rms", "", f"{cell(1e3 * NOISE, 1)} mA"],
            ["in a direction of the plane, mean of all directions", "N2", f"{cell(1e3 * NOISE * math.sqrt(SENSORS), 2)} mA"],
            ["amplitude at 600 Hz in one injection period of ten samples", "N4", f"{cell(1e3 * NOISE * WHITE, 2)} mA"],
            ["signal q in one period, over the injection current", "N5", f"{cell(period, 5)}"],
            ["as an angle, over \\|k\\|", "N5", f"{cell(period / k * DEG, 1)}°"],
            ["one reading of the averages, which overlap", "N6", f"{cell(reading / k * DEG, 1)}°"],
            ["what the filter assumes for one period", "N7", f"{cell(code, 5)}, {cell(code / k * DEG, 1)}°"],
            ["angle error in the closed loop, 1 A, shaft locked", "N15", f"{cell(f.noise_deg(), 1)}°"],
        ],
    )


def filters():
    for i_q in (0.0, 1.0, 2.0, 3.0):
        yield i_q, 0.0, "locked"
    for i_q in (1.0, 3.0):
        yield i_q, -i_q / (I_D * M.tau), "zero stator frequency"
    yield 1.0, 30.0, "rotating, 30 rad/s"


def block_filter():
    rows = []
    for i_q, rotor, name in filters():
        f = Filter(i_q, rotor)
        freq, margin, up, _, peak = f.margins()
        rows.append(
            [
                cell(i_q, 0), name, cell(f.l, 0), cell(f.h, 0), cell(f.deg, 2), cell(math.sqrt(f.p[1][1]), 2), cell(f.k1[0] / T, 1),
                cell(freq, 1), cell(margin, 0), cell(up, 1), cell(peak, 2), cell(f.noise_deg(), 2),
            ]
        )
    heads = ["i_q, A", "shaft", "l, 1/s", "h, 1/s", "√P_ee, °", "√P_ww, rad/s", "K_e/T, 1/s", "crossover, Hz", "phase margin, °", "gain margin", "sensitivity peak", "noise, °"]
    return table(heads, rows)


def block_alone():
    rows = []
    for hz in (1.0, 2.0, 3.5, 5.0, 8.0):
        f = Filter(1.0, 0.0, observer=False, hz=hz)
        freq, margin, up, _, peak = f.margins()
        w = TAU * hz
        rows.append([cell(hz, 1), f"{cell(f.k1[0] / T, 1)} / {cell(2 * w, 1)}", cell(freq, 1), cell(margin, 0), cell(up, 1), cell(peak, 2), cell(f.noise_deg(), 2)])
    return table(["bandwidth, Hz", "K_e/T and 2 ω_n, 1/s", "crossover, Hz", "phase margin, °", "gain margin", "sensitivity peak", "noise, °"], rows)


def block_bias():
    rows = []
    for w in (375.0, 61.0):
        for h in (50e-6, 100e-6, 200e-6):
            for name, model in (("B", model_b), ("C", model_c), ("D", model_d)):
                if name == "D" and h != 50e-6:
                    continue
                values = [0.0 if abs(x) < 5e-4 else x for x in bias(model, w, h)]
                rows.append([cell(w, 0), cell(1e6 * h, 0), name, *(cell(x, 2) for x in values)])
    return table(["ω_m, rad/s", "h, µs", "model", "r_s, %", "τ_r, %", "σl_s, %", "l_s, %", "ω_m, %"], rows)


BLOCKS = {
    "theory.md": {"theory-motor": block_motor, "theory-offset": block_offset, "theory-zeros": block_zeros, "theory-barrier": block_barrier, "theory-false": block_false, "theory-trip": block_trip},
    "theory-estimation.md": {"theory-voltage": block_voltage, "theory-resistance": block_resistance, "theory-chain": block_chain, "theory-filter": block_filter, "theory-alone": block_alone},
    "sources.md": {"theory-impedance": block_impedance, "theory-leak": block_leak, "theory-direct": block_direct, "theory-bias": block_bias},
}

NUMBERS = {}


def compute():
    """Numbers by name, which sentences of the pages quote."""
    n = NUMBERS
    s = tensor(complex(I_D, 2.0), 1)
    n["re_s_2a"], n["im_s_2a"] = s.real, s.imag
    n["ref_2a"] = signal(s)
    n["lasting_2a"], n["fast_2a"] = slope(q_slow, 2.0), slope(q_fast, 2.0)
    n["fast_15"] = slope(q_fast, 1.5) / slope(q_slow, 1.5)
    n["fast_0"] = slope(q_fast, 0.0) / slope(q_slow, 0.0)
    n["noise_1a_deg"] = Filter(1.0, 0.0).noise_deg()
    n["mismatch_1"] = 100 * mismatch(0.01)
    n["warm_max"] = (math.atan(math.sqrt(1.3)) - math.atan(1 / math.sqrt(1.3))) * DEG
    n["drift_per_min"] = 0.01 / (M.tau * I_D) * DEG * 60 / M.pairs
    n["half_volt"] = M.r_rotor * math.sin(math.radians(30))
    n["limit_ref_3a"] = 2 * B1 * I_D / (1 - A_PSI + 3 * B1)
    n["early_15"], n["early_3"] = (slope(q_slow, i_q, follows=False) for i_q in (1.5, 3.0))
    n["silent_n"] = (1 - constant(SETTINGS, "allowed_deficit")) * abs(A_PSI)
    n["rotating_leakage"] = 100 * B1 * 2.71 * math.sqrt(2)
    n["gamma_2a"] = math.atan2(2, I_D) * DEG
    return n


def quotes():
    """Sentences, or parts of them, that the pages must contain."""
    n = NUMBERS
    x = OMEGA * M.sigma_ls
    triangle = [min(k + 1, 39 - k) / 400 for k in range(39)]
    period = WHITE / math.sqrt(SENSORS)
    dr = 0.01 * M.r_s * abs(complex(I_D, 1))
    flux = M.coupled * I_D
    tangent = 1 / I_D
    m4 = main_saliency(1.3, 4)
    low = min(x[3] for x in margins_of_the_table())
    return {
        "theory.md": [
            f"changes the voltage by {n['half_volt']:.2f} V per ampere of stator current",
            f"a residue of the dead time alone leaves {RESIDUAL:.1f} V",
            f"a = {cell(100 * A_PSI, 1)} % and b = {100 * B1:.1f} % per ampere",
            f"The angle γ is {n['gamma_2a']:.1f}°, (T17) gives s = {cell(n['re_s_2a'], 4)} + {n['im_s_2a']:.4f} j, (T18) gives q_ref = {n['ref_2a']:.4f}, "
            f"(T22) gives k = {cell(n['lasting_2a'], 4)} /rad, and (T23) gives k_fast = {cell(n['fast_2a'], 4)} /rad",
            f"The formulas give {100 * q_slow(I_D, 2.0, 0):.2f} % and {100 * q_slow(I_D, 2.0, 10 / DEG):.2f} %",
            f"a plant with {n['fast_15']:.1f} times the gain at 1.5 A",
            f"the fast one grows from {n['fast_0']:.2f} of it to {slope(q_fast, 3.0) / slope(q_slow, 3.0):.1f} times as much",
            f"at 3 A this limit is {n['limit_ref_3a']:.4f}, and q_ref is {signal(tensor(complex(I_D, 3.0), 1)):.4f}",
            f"With i_q = 1.5 A this is {cell(n['early_15'], 4)} /rad, which is {100 - 100 * n['early_15'] / slope(q_slow, 1.5):.0f} % less than the lasting "
            f"{cell(slope(q_slow, 1.5), 4)} /rad. With i_q = 3 A it is {100 - 100 * n['early_3'] / slope(q_slow, 3.0):.0f} % less",
            f"1/(2π τ_r) = {M.alpha / TAU:.2f} Hz sees (T22a). The default loop has {constant(SETTINGS, 'bandwidth_hz')} Hz",
            f"(exactly at {zeros(lambda x: slope(q_fast, x) - slope(q_slow, x), 0.3, 1.5, 60)[0]:.2f} A)",
            f"the lasting one stays within {math.ceil(max(abs(100 - 50 * slope(q_slow, x) / A_PSI) for x in OFFSET_CURRENTS))} % of 2a",
            f"it is {cell(slope(q_slow, 0.0), 3)} to {cell(slope(q_slow, 3.0), 3)} /rad if the flux has settled, and {cell(slope(q_slow, 0.0), 3)} to "
            f"{cell(n['early_3'], 3)} /rad before",
            f"The second value is {-100 * 0.07 / slope(q_slow, 1.5) - 100:.1f} % larger in magnitude than the {cell(slope(q_slow, 1.5), 4)} /rad of (T22)",
            f"for example +{fast_zero_slope(1.5):.3f} /rad at 1.5 A",
            f"This is +{flux_gone(0.5):.2f} % at 0.5 A and +{flux_gone(1.0):.2f} % at 1 to 3 A",
            f"the curve ends {flux_gone(2.0):.2f} % above q_ref",
            f"gives {100 * min(map(first_order_barrier, OFFSET_CURRENTS[1:])):.0f} to {100 * max(map(first_order_barrier, OFFSET_CURRENTS[1:])):.0f} % less",
            f"At the barrier at 2 A it asks for {100 * exact_share(2.0):.0f} % more than (T26)",
            f"is {barrier(3.0)[0] / mismatch(0.01) / 1.5:.2f} % or {barrier(3.0)[0] / mismatch(0.01) / 0.5:.2f} %, depending",
            f"The deficit at the barrier is {min(deficit(x, barrier(x)[1]) for x in OFFSET_CURRENTS[1:]):.2f} to "
            f"{max(deficit(x, barrier(x)[1]) for x in OFFSET_CURRENTS[1:]):.2f}",
            f"|n| exceeds {1 - constant(SETTINGS, 'allowed_deficit'):.2f} |a| = {100 * n['silent_n'] + 1e-9:.2f} %. This takes a mismatch of "
            f"{n['silent_n'] / mismatch(1.0) * 100:.1f} %; in full it takes {100 * never_trips(2.0):.1f} % at 2 A",
            f"hence {n['mismatch_1']:.2f} % for g = 1 %",
            f"At 3 A a mismatch of {barrier(3.0)[0] / mismatch(0.01):.2f} % that the drive does not know is enough",
            f"an asymmetry of {100 * abs(restoring(2.0, fixed_frame(2.0, -150)[2])):.2f} % holds the frame",
            f"the barrier, is {100 * barrier(2.0)[0]:.2f} %",
            f"above a deficit of {constant(SETTINGS, 'allowed_deficit'):.2f}",
            f"The simulated motor has {cell(100 * A_PSI, 1)} %, fixed to the flux, and {100 * B1:.1f} % per ampere",
            f"{V_INJ:.0f} V peak by default, {100 * V_INJ / (M.dc_link / math.sqrt(3)):.0f} % of what a dc link of {M.dc_link} V gives",
            f"| current | {V_INJ / x:.2f} A peak",
            f"| torque ripple | {M.torque(I_D, V_INJ / x):.3f} Nm peak",
        ],
        "sources.md": [
            f"{100 * M.sigma * M.tau * 50e-6 * 375**2 / 2:.1f} % at 375 rad/s and 50 µs",
            f"the resistance is {100 * M.r_s / x:.1f} % of the reactance",
            f"differ by {100 * (abs(complex(M.r_s + M.r_rotor, x)) / abs(complex(M.r_s, x)) - 1):.3f} %",
            f"a gain of g = {abs(response(sections(FILTERS, 'BPF'), 0)):.4f} at dc",
            f"h = {abs(response(sections(FILTERS, 'PP'), 0)):.3f} is the dc gain of PP",
            f"attenuates it by {-20 * math.log10(abs(response(sections(FILTERS, 'PP'), F_INJ))):.1f} dB",
            f"√2 g i_d = {leak(0.0, -math.pi / 2):.1f} mA at −90°",
            f"is {leak(0.0, -math.pi / 2):.2f} mA times h",
            f"At 2 A this is {100 * ((1 - n['re_s_2a']) / (1 + n['re_s_2a']) - 1):.0f} %",
        ],
        "theory-estimation.md": [
            f"with i_d = {I_D} A and i_q = 1 A is {dr:.3f} V. It turns a flux of {flux:.3f} Wb by up to {dr / flux * DEG:.0f}° in the first second",
            f"R_R = {M.r_rotor:.2f} Ω, so a change of 0.5 A shows {0.5 * M.r_rotor:.1f} V",
            f"{constant(INVERTER, 'residual_v'):.2f} V per phase",
            f"4/π · {constant(INVERTER, 'residual_v'):.2f} V = {RESIDUAL:.2f} V",
            f"With i_q = 1 A, i_d = 0.7 A and δ = 1 % this is {n['drift_per_min']:.0f} mechanical degrees per minute",
            f"One degree at 1 A is {(1 + tangent**2) / M.tau:.0f} electrical degrees per second",
            f"For c = 1.3 this is {n['warm_max']:.1f}°",
            f"with Σ w² = {sum(w * w for w in triangle):.4f}",
            f"The factor {constant(ESTIMATOR, 'AVERAGED_NOISE'):.2f} (`AVERAGED_NOISE`) is {constant(ESTIMATOR, 'AVERAGED_NOISE') / WHITE:.2f} times the "
            f"{WHITE:.3f} that (N4) gives for the mean direction, and {constant(ESTIMATOR, 'AVERAGED_NOISE') / (period * math.sqrt(2)):.2f} times the "
            f"{period * math.sqrt(2):.3f} of the worst direction",
            f"is {cell(direction(0), 2)}, {cell(direction(60), 2)} and {cell(direction(150), 2)} σ². At 2.5 A the prediction is "
            + ", ".join(f"{zero_frequency(chi):.1f}°" for chi in (0, 60)) + f" and {zero_frequency(150):.1f}°",
            f"s_0 = {constant(OBSERVER, 'GAIN_AT_STANDSTILL'):.0f}, c = {constant(OBSERVER, 'GAIN_PER_SPEED')}",
            f"({math.sqrt(Filter(1.0, 0.0).r1) * DEG:.1f}°)²",
            f"({math.sqrt(Filter(1.0, 0.0).r2):.1f} rad/s)²",
            f"({math.sqrt(Filter(1.0, 0.0).rate):.0f} rad/s²)²",
            f"a load step of {100 * constant(ESTIMATOR, 'LOAD_STEP'):.0f} % of the rated torque",
            f"{constant(ESTIMATOR, 'SLIP') ** 2:.0f} (rad/s)²",
            f"√({constant(ESTIMATOR, 'SLOW')}² + ({constant(ESTIMATOR, 'SLOW_OF_RATED')} ω_N)² + ({constant(ESTIMATOR, 'SLOW_OF_SLIP')} s_max)²) | {Filter(1.0, 0.0).slow:.1f} rad/s, τ_b = {Filter(1.0, 0.0).slow_s:.1f} s",
            f"| standard deviation of d | what the rotor equation does not explain | {100 * constant(FILTER, 'GROWTH'):.1f} % |",
            f"| τ_s | decay to the measured resistance | {constant(OBSERVER, 'RESISTANCE_S'):.0f} s |",
            f"`injection.bandwidth_hz` sets ω_n = 2π · {constant(SETTINGS, 'bandwidth_hz')} Hz",
            f"Well above 1/τ_r = {M.alpha:.1f} /s",
            f"a phase margin of at least {math.floor(low)}° and a gain margin of at least {math.floor(10 * min(x[4] for x in margins_of_the_table())) / 10}",
            f"up to {slope(q_fast, 3.0) / slope(q_slow, 3.0):.1f} times the lasting one",
        ],
        "plants.md": [
            f"this is +{n['rotating_leakage']:.0f} %",
            f"the main inductance is {1e3 * m4[0]:.1f} mH along the flux and {1e3 * M.l_m:.1f} mH across it. The motor shows {1e3 * m4[1]:.1f} mH and "
            f"{1e3 * m4[2]:.1f} mH, a saliency of **+{100 * m4[3]:.2f} %**",
            f"For n = 6 (`m6`) it is +{100 * main_saliency(1.3, 6)[3]:.2f} %",
            f"at the {2.71 * math.sqrt(2):.2f} A peak".replace("at the", "At the"),
        ],
    }


def fast_zero_slope(i_q, h=1e-5):
    """Slope of a fast error at its second zero, 1/rad."""
    at = second_zeros(i_q)[0][0] / DEG
    return (q_fast(I_D, i_q, at + h) - q_fast(I_D, i_q, at - h)) / (2 * h)


def flux_gone(i_q):
    """q - q_ref where the flux is gone, %; the formula of the page must agree."""
    value = restoring(i_q, math.atan2(i_q, I_D) - math.pi / 2)
    s = tensor(complex(I_D, i_q), 1)
    assert abs(value + A_PSI * signal(s) / (1 - s.real + A_PSI)) < 1e-9
    return 100 * value


def first_order_barrier(i_q):
    """Share by which Eq. T25 gives a lower barrier than Eq. T16 and T19."""
    gamma = math.atan2(i_q, I_D)
    first = max(abs(A_PSI * flux_share(gamma, e) * math.sin(2 * e)) for e in span(gamma - math.pi / 2, 0, 2000))
    return 1 - first / barrier(i_q)[0]


def exact_share(i_q):
    """Share by which the exact condition asks for more asymmetry at the barrier than Eq. T26: there Re n' is 0."""
    at = barrier(i_q)[1]
    gamma = math.atan2(i_q, I_D)
    return -tensor(complex(I_D, i_q), math.cos(gamma - at) / math.cos(gamma) * cmath.exp(1j * at)).real


def direction(degrees):
    """Variance of the noise in a direction, relative to that of a sensor, Eq. N2."""
    c, s = math.cos(degrees / DEG), math.sin(degrees / DEG)
    return c * c + 5 / 3 * s * s + 2 / math.sqrt(3) * s * c


def zero_frequency(degrees):
    """Noise of the angle, degrees, at 2.5 A and zero stator frequency, with the flux in this direction."""
    return Filter(2.5, -2.5 / (I_D * M.tau)).noise_deg() * math.sqrt(direction(degrees) / SENSORS)


def margins_of_the_table():
    """i_q, shaft, crossover, phase margin, gain margin of the rows of `theory-filter` with a slowly turning shaft."""
    if "margins" not in NUMBERS:
        rows = []
        for i_q, rotor, name in filters():
            if rotor <= 0:
                freq, margin, up, *_ = Filter(i_q, rotor).margins()
                rows.append((i_q, name, freq, margin, up))
        NUMBERS["margins"] = rows
    return NUMBERS["margins"]


def main_saliency(factor, n):
    """Incremental main inductance along the flux, inductances along and across at 600 Hz, saliency, for a saturated main flux, Eq. M15."""
    along = factor * M.l_m / (1 + (n + 1) * (factor - 1))
    l_ls, l_lr = M.l_s - M.l_m, M.l_r - M.l_m
    shown = [l_ls + l * l_lr / (l + l_lr) for l in (along, M.l_m)]
    return along, shown[0], shown[1], (shown[1] - shown[0]) / (shown[1] + shown[0])


# ------------------------------------------------------------------------------------------------------------------------------- main

DRAWN = [
    picture_ellipse, picture_q, picture_sensitivity, picture_false_lock, picture_observability, picture_leak, picture_resistance,
    picture_noise, picture_loop, picture_torque_map, picture_system,
    picture_source_vectors, picture_source_schemes, picture_source_angle_loop,
]


def with_block(page, name, block):
    """Returns the page with this block between its comments."""
    head = f"<!-- generated: {name} (python3 docs/pictures/theory.py) -->"
    if page.count(head) != 1:
        sys.exit(f"no place, or more than one, for {head}")
    before, rest = page.split(head)
    _, after = rest.split("<!-- end -->", 1)
    return f"{before}{head}\n\n{block}\n<!-- end -->{after}"


def close(a, b):
    """Whether two pictures are equal but for the last digit of a coordinate, which may depend on the platform's functions."""
    number = re.compile(r"-?[0-9]+(?:[.][0-9]+)?")
    if number.sub("0", a) != number.sub("0", b):
        return False
    return all(abs(float(x) - float(y)) < 0.25 for x, y in zip(number.findall(a), number.findall(b)))


def main():
    check = "--check" in sys.argv
    wrong = []
    compute()
    if "--print" in sys.argv:
        for name, value in NUMBERS.items():
            print(f"{name} = {value:.6g}")
        return
    for draw in DRAWN:
        picture = draw()
        path = PICTURES / f"{picture.name}.svg"
        text = picture.svg()
        if not check:
            path.write_text(text, encoding="utf-8")
        elif not path.exists() or not close(text, path.read_text(encoding="utf-8")):
            wrong.append(f"{path.name} is not the picture that this script draws")
    for name, blocks in BLOCKS.items():
        path = DOCS / name
        old = page = path.read_text(encoding="utf-8")
        for block, make in blocks.items():
            page = with_block(page, block, make())
        if not check:
            path.write_text(page, encoding="utf-8")
        elif page != old:
            wrong.append(f"{name}: a generated table differs")
    for name, sentences in quotes().items():
        page = " ".join((DOCS / name).read_text(encoding="utf-8").split())
        wrong += [f"{name} lacks: {sentence}" for sentence in sentences if sentence not in page]
    if ud_matches() > 2e-15:
        wrong.append(f"the U-D recursion differs from the covariance by {ud_matches():.1e}")
    if wrong:
        sys.exit("\n".join(wrong))
    print("pictures, tables and numbers of the theory pages are those of the script" if check else "written")


if __name__ == "__main__":
    main()
