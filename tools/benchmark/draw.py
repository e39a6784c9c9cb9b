"""Random numbers that are the same on every machine, and the experiments that are drawn with them."""
import math

MASK = (1 << 64) - 1


class Random:
    """splitmix64."""

    def __init__(self, seed):
        self.state = seed & MASK

    def uniform(self, low=0.0, high=1.0):
        self.state = (self.state + 0x9E3779B97F4A7C15) & MASK
        z = self.state
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & MASK
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK
        return low + (high - low) * ((z ^ (z >> 31)) >> 11) * 2.0**-53

    def log_uniform(self, low, high):
        return math.exp(self.uniform(math.log(low), math.log(high)))

    def pick(self, options):
        return options[int(self.uniform() * len(options))]


PLANTS = ("rig", "car")
NOISES = {"lab": 0.4, "production": 1.0, "harsh": 3.0}  # times the shipped scenario's noise
FAMILIES = ("tanh_fall", "magic_formula", "broad_top", "plateau", "rising")
KINDS = ("clean", "clean", "biased", "disturbed")
SLIP_PERCENT = (0.8, 8.0)  # at the peak
FALL_PER_PERCENT = (5e-4, 8e-3)
RISING_PER_PERCENT = (6e-4, 2e-3)
RISING_TO_PERCENT = 50.0  # where no experiment comes
TORQUE_GAIN = 0.02  # one sigma of a biased sensor
PRESSURE_BIAS_PA = 10e3
COS_WEDGE, RADIUS_M = math.cos(math.radians(11.0)), 0.0784


def combination(number):
    """Plant, noise, family and kind of experiment NUMBER, each combination once in 120."""
    rest, plant = divmod(number, 2)
    rest, noise = divmod(rest, len(NOISES))
    rest, family = divmod(rest, len(FAMILIES))
    return PLANTS[plant], list(NOISES)[noise], FAMILIES[family], KINDS[rest % len(KINDS)]


def draw_curve(random, family, plant):
    """Keys of a belt's section, and what a scorer has to know."""
    mu_max = random.uniform(0.07, 0.13) if plant == "rig" else random.uniform(0.085, 0.115)
    slip = random.log_uniform(*SLIP_PERCENT)
    fall = random.log_uniform(*FALL_PER_PERCENT)
    keys = {"curve": "tanh_fall", "mu_max": mu_max, "peak_slip_percent": slip,
            "fall_per_percent": fall}
    if family == "magic_formula":
        keys["curve"] = "magic_formula"
    elif family == "plateau":
        keys["plateau_percent"] = random.uniform(0.5, 2.0)
    elif family == "broad_top":
        keys.update(curve="broad_top", knee_slip_percent=0.4 * slip,
                    rise_per_percent=random.uniform(0.02, 0.08) * mu_max / slip)
    elif family == "rising":
        along = random.uniform(*RISING_PER_PERCENT)
        keys.update(curve="broad_top", knee_slip_percent=0.6 * slip, rise_per_percent=along,
                    peak_slip_percent=RISING_TO_PERCENT,
                    mu_max=mu_max + along * (RISING_TO_PERCENT - 10.0))
    return keys


def toml(values):
    """Scalars as lines of a TOML file."""
    return "".join(f'{k} = "{v}"\n' if isinstance(v, str) else f"{k} = {v:.9g}\n"
                   for k, v in values.items())


def fault(**keys):
    flags = {k: v for k, v in keys.items() if isinstance(v, bool)}
    lines = "".join(f"{k} = {'true' if v else 'false'}\n" for k, v in flags.items())
    return "\n[[fault]]\n" + lines + toml({k: v for k, v in keys.items() if k not in flags})


def draw_rig(random, noise, family, kind):
    """Scenario file of a ramp on the rig, the belt's keys, when a reading steps (None: never)."""
    belt = draw_curve(random, family, "rig")
    torque_Nm = random.uniform(25.0, 80.0)
    ramp = random.log_uniform(26.0, 400.0)
    top = belt["mu_max"] - (belt.get("rise_per_percent", 0.0) * (RISING_TO_PERCENT - 10.0)
                            if family == "rising" else 0.0)
    needed_N = torque_Nm * COS_WEDGE / (2.0 * RADIUS_M * top)
    start_N = needed_N + max(0.6 * needed_N, 8.0 * ramp)
    sensors = {"primary_speed_noise_rad_s": 0.08, "secondary_speed_noise_rad_s": 0.18,
               "torque_noise_Nm": 0.5, "pressure_noise_Pa": 2000.0}
    sensors = {k: NOISES[noise] * v for k, v in sensors.items()}
    if kind == "biased":
        sensors["torque_gain"] = random.pick((-1, 1)) * random.uniform(0.5, 1.5) * TORQUE_GAIN
        sensors["pressure_bias_Pa"] = random.pick((-1, 1)) * random.uniform(0.5, 1.5) * PRESSURE_BIAS_PA
    text = toml({"name": "benchmark", "belt": "drawn"})
    text += "\n[driveline]\n" + toml({"primary_speed_rad_s": random.uniform(90.0, 200.0),
                                      "primary_torque_Nm": torque_Nm,
                                      "secondary_inertia_kg_m2": random.log_uniform(0.05, 0.5)})
    text += "\n[clamp]\n" + toml({"start_force_N": start_N, "ramp_N_per_s": ramp})
    # Nobody lets go before a method may have stopped.
    text += "\n[operator]\n" + toml({"slip_percent": 25.0, "reaction_s": 0.2})
    peak_s = (start_N - needed_N) / ramp
    text += "\n[run]\n" + toml({"duration_s": 1.3 * peak_s + 10.0})
    text += "\n[sensors]\n" + toml(sensors) + "\n[belts.drawn]\n" + toml(belt)
    at_s = None
    if kind == "disturbed":
        # A reading steps where mu* is at three quarters to nine tenths of its top.
        share = random.uniform(0.75, 0.9)
        at_s = max(1.0, (start_N - needed_N / share) / ramp)
        if random.uniform() < 0.5:
            text += fault(kind="signal_gain", channel="PrimaryTorque", at_s=at_s, for_s=1e3,
                          size=random.pick((0.93, 1.07)))
        else:
            text += fault(kind="signal_bias", channel="SecondaryPressure", at_s=at_s,
                          for_s=1e3, size=random.pick((-1.0, 1.0)) * 0.06 * needed_N / 0.0113)
    return text, belt, at_s


def draw_car(random, noise, family, kind):
    """The same of a coast-down whose transmission goes on holding what it was asked for; the time
    counts from the request.
    """
    belt = draw_curve(random, family, "car")
    sensors = {"primary_speed_noise_rad_s": 0.05, "secondary_speed_noise_rad_s": 0.10,
               "engine_speed_noise_rad_s": 0.1, "torque_noise_Nm": 0.2, "pressure_noise_Pa": 1000.0}
    sensors = {k: NOISES[noise] * v for k, v in sensors.items()}
    if kind == "biased":
        sensors["torque_gain"] = random.pick((-1, 1)) * random.uniform(0.5, 1.5) * TORQUE_GAIN
        sensors["pressure_bias_Pa"] = random.pick((-1, 1)) * random.uniform(0.5, 1.5) * PRESSURE_BIAS_PA
    text = toml({"plant": "vehicle", "name": "benchmark"})
    text += "\n[belt]\n" + toml(belt) + "\n[sensors]\n" + toml(sensors)
    text += "\n[engine]\n" + toml({"overrun_torque_Nm": random.uniform(28.0, 45.0)})
    text += "\n[vehicle]\n" + toml({"mass_kg": random.uniform(1100.0, 1700.0)})
    text += fault(kind="tcu_latches", at_s=0.0, for_s=1e3)
    at_s = None
    if kind == "disturbed":
        at_s = random.uniform(1.0, 3.0)
        text += fault(kind="signal_gain", channel="EngineTorque", after_request=True, at_s=at_s,
                      for_s=1e3, size=random.pick((0.93, 1.07)))
    return text, belt, at_s
