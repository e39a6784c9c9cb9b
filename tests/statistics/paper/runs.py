"""One run of the simulated rig, and what a method makes of it: the programs as users call them."""
import json
import re
import statistics
import subprocess
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

SETS = {"Quiet": 1, "Excited": 2, "Peak": 3, "MacroSlip": 4}
COLUMNS = ["t_s", "mu_star", "sigma_star_percent", "slip_variance", "friction_slope", "phase"]
NO_OPERATOR = ['operator.action="none"']
DAMAGING = ["operator.slip_percent=25"]  # Figures 6 and 7: the run that damaged the belt


@dataclass
class Row:
    """A sample of the estimator."""
    t_s: float
    mu: float
    slip: float
    variance: float
    slope: float
    set: int


@dataclass
class Trial:
    truth: float
    peak_s: float
    let_go_s: float | None
    stop_s: float | None
    mu_max: float | None
    covered: bool
    slip_percent: float | None
    rows: list = field(default_factory=list)
    most_slip_percent: float | None = None  # until the force is back

    @property
    def by_itself(self):
        """Stopped before the simulated operator let go."""
        return self.stop_s is not None and (self.let_go_s is None or self.stop_s < self.let_go_s)

    @property
    def error_percent(self):
        return None if self.mu_max is None else 100.0 * (self.mu_max / self.truth - 1.0)

    @property
    def delay_s(self):
        return self.stop_s - self.peak_s if self.by_itself else None

    def open_rows(self):
        """Samples with the gate open, up to the stop."""
        last = self.stop_s if self.by_itself else self.let_go_s
        return [r for r in self.rows if r.set > 1 and (last is None or r.t_s <= last + 1e-9)]

    @property
    def gate_lead_s(self):
        rows = self.open_rows()
        return self.peak_s - rows[0].t_s if rows else None

    @property
    def quiet_s(self):
        """Set (1)."""
        rows = self.open_rows()
        return rows[0].t_s if rows else None

    def duration_s(self, number):
        return sum(r.set == number for r in self.open_rows()) / 200.0

    @property
    def in_order(self):
        """Sets (2), (3), (4) are there, and begin and have their middle in this order."""
        times = {n: [r.t_s for r in self.open_rows() if r.set == n] for n in (2, 3, 4)}
        if not all(times.values()):
            return False
        begin = [times[n][0] for n in (2, 3, 4)]
        middle = [statistics.median(times[n]) for n in (2, 3, 4)]
        return begin == sorted(begin) and middle == sorted(middle)


class Bench:
    """Simulates each run once; keeps its log while it lives."""

    def __init__(self, program):
        self.program = program
        self.folder = tempfile.TemporaryDirectory(prefix="beltgrip.")
        self.made = {}

    def close(self):
        self.folder.cleanup()

    def call(self, *arguments):
        done = subprocess.run([self.program, *map(str, arguments)], capture_output=True, text=True)
        if done.returncode != 0:
            raise RuntimeError(f"{' '.join(map(str, arguments))}: {done.stderr}")
        return done.stdout

    def simulate(self, scenario, belt, seed, settings=()):
        key = (scenario, belt, seed, tuple(settings))
        if key not in self.made:
            place = Path(self.folder.name) / str(len(self.made))
            options = [word for each in settings for word in ("--set", each)]
            self.call("simulate", "--scenario", scenario, "--belt", belt, "--seed", seed,
                      "--out-dir", place, *options)
            self.made[key] = place
        return self.made[key]

    def forget(self, scenario, belt, seed, settings=()):
        place = self.made.pop((scenario, belt, seed, tuple(settings)))
        for path in place.iterdir():
            path.unlink()

    def replay(self, place, method, options=None, trace=False):
        text = (place / "beltgrip.toml").read_text()
        lines = [f'method = "{method}"'] + [f"{k} = {v}" for k, v in (options or {}).items()]
        text = re.sub(r'^method = .*$', "\n".join(lines), text, flags=re.M)
        (place / "asked.toml").write_text(text)
        arguments = ["replay", place / "trace.log", "--config", place / "asked.toml", "--json", "-"]
        if trace:
            arguments += ["--trace", place / "trace.csv"]
        found = json.loads(self.call(*arguments).splitlines()[0])
        truth = json.loads((place / "truth.json").read_text())["experiments"][0]
        low, high = found.get("mu_max_ci95") or (1.0, 0.0)
        trial = Trial(truth["mu_max"], truth["peak_s"], truth.get("let_go_s"), found.get("stop_s"),
                      found.get("mu_max"), low <= truth["mu_max"] <= high,
                      found.get("sigma_stop_percent"))
        if trace:
            trial.rows = read_trace(place / "trace.csv")
            trial.most_slip_percent = max(r.slip for r in trial.rows)
        return trial


def read_trace(path):
    rows = []
    with open(path) as file:
        columns = next(file).rstrip("\n").split(",")
        if columns[:6] != COLUMNS:
            raise RuntimeError(f"{path}: begins with {columns[:6]}, expected {COLUMNS}")
        for line in file:
            t_s, mu, slip, variance, slope, phase = line.split(",", 6)[:6]
            rows.append(Row(float(t_s), float(mu), float(slip), float(variance), float(slope),
                            SETS[phase]))
    return rows
