#!/usr/bin/python3
"""paper_document.py BELTGRIP SOURCE [--write]: estimator/PAPER.md and estimator/paper_figures.svg.

With --write all runs are made and both files written. Without: one seed; the files must have the
form that is written now, this seed's figures must lie within the ranges they name, and what is
promised of the default reading must hold.
"""
import argparse
import re
import statistics
import sys
from pathlib import Path

import picture
import runs

# The scenario was chosen with the seeds 1 to 8; none of these had been run before that was done.
FIRST_SEED = 101
SEEDS = 20
TRIED = 1
RIGS = ("paper-figures", "paper-rig")
BELTS = ("new", "worn")
REPORTED = {"new": 0.105, "worn": 0.100}
THRESHOLDS = {"c_v": 0.05, "c_k": -1e-3, "c_m": 1e-3}  # Table I
# What is open in the text: options of [estimator], the default first.
READINGS = (
    {},
    {"peak_samples": '"last"'},
    {"reopening": '"initial_slope"'},
    {"reopening": '"paused"'},
    {"initial_slope": 0.03},
    {"initial_slope": 0.0},
    {"initial_variance": 1e3},
    {"initial_variance": 1e5},
    {"initial_slope": 0.0, "initial_variance": 100, "reopening": '"initial_slope"'},
)
BEFORE = "paper, as before"
METHODS = {"paper": ("paper", {}), BEFORE: ("paper", READINGS[-1]), "robust": ("robust", {})}
MEAN_ERROR_MAX_PERCENT = 1.5
ERROR_MAX_PERCENT = 3.0
DELAY_MAX_S = 1.0


def spread(values, form):
    """least / mean / greatest."""
    values = [v for v in values if v is not None]
    if not values:
        return "none"
    return " / ".join(form % v for v in (min(values), statistics.fmean(values), max(values)))


def count(flags):
    flags = list(flags)
    return f"{sum(flags)} of {len(flags)}"


class Measured:
    """All trials that the document tells of."""

    def __init__(self, program, seeds):
        self.trials, self.readings = {}, {}
        bench = runs.Bench(program)
        for rig in RIGS:
            for belt in BELTS:
                for seed in range(FIRST_SEED, FIRST_SEED + seeds):
                    self.run(bench, rig, belt, seed)
        self.shown = show(bench)
        self.escape = {belt: escape(bench, belt) for belt in BELTS}
        self.secondary = secondary_share(bench)
        bench.close()

    def run(self, bench, rig, belt, seed):
        for operator in (True, False):
            settings = () if operator else tuple(runs.NO_OPERATOR)
            place = bench.simulate(rig, belt, seed, settings)
            for name, (method, options) in METHODS.items():
                if name == BEFORE and rig == RIGS[0]:
                    continue
                trial = bench.replay(place, method, options, trace=method == "paper")
                self.trials.setdefault((rig, belt, operator, name), []).append(trial)
            if operator and rig == RIGS[0]:
                for number, options in enumerate(READINGS):
                    trial = bench.replay(place, "paper", options, trace=True)
                    trial.rows = trial.open_rows()  # the rest is not asked for
                    self.readings.setdefault((number, belt), []).append(trial)
            bench.forget(rig, belt, seed, settings)


def lowering(trial):
    """Up to where the operator lets go."""
    if trial.let_go_s is not None:
        trial.rows = [r for r in trial.rows if r.t_s <= trial.let_go_s]
    return trial


def show(bench):
    damaging = bench.simulate(RIGS[0], "new", FIRST_SEED, runs.DAMAGING)
    before, after = (bench.simulate(RIGS[0], belt, FIRST_SEED) for belt in BELTS)
    return [lowering(bench.replay(place, "paper", options, trace=True))
            for place, options in ((damaging, {}), (damaging, {"lowpass_hz": 1.0}), (before, {}),
                                   (after, {}))]


def escape(bench, belt):
    """Equations (7) and (8): the least slip in the mean over 2 s, and the friction there."""
    rows = bench.replay(bench.simulate(RIGS[0], belt, FIRST_SEED), "paper", trace=True).rows
    means = [(statistics.fmean(r.slip for r in rows[i:i + 400]),
              statistics.fmean(r.mu for r in rows[i:i + 400])) for i in range(0, len(rows) - 400, 100)]
    return min(means)


def secondary_share(bench):
    """Equation (4) for the secondary pulley over (5), in the mean over the quiet first 60 s."""
    place = bench.simulate(RIGS[0], "new", FIRST_SEED)
    dbc, log = place / "vehicle.dbc", place / "trace.log"
    text = bench.call("dbc", "decode", "--dbc", dbc, log, "--json", "-")
    shares = [(float(a), float(b)) for a, b in re.findall(
        r'"PrimaryTorque":([-\d.e]+),"SecondaryTorque":([-\d.e]+)', text)[:12000]]
    primary, secondary = (statistics.fmean(s[i] for s in shares) for i in (0, 1))
    return 2.25 * secondary / primary  # R_p / R_s = r_g0 at the end stop


def result_rows(measured):
    for (rig, belt, operator, method), trials in measured.trials.items():
        paper = method != "robust"
        cells = [f"`{rig}`", f"{belt}, {REPORTED[belt]:.3f}", "lets go" if operator else "none",
                 f"`{method}`", count(t.by_itself for t in trials),
                 spread([t.mu_max for t in trials], "%.4f"),
                 spread([t.error_percent for t in trials], "%+.2f %%"),
                 spread([t.delay_s for t in trials], "%+.2f s"),
                 spread([t.slip_percent for t in trials if t.by_itself], "%.1f %%"),
                 count(t.covered for t in trials),
                 count(t.in_order for t in trials) if paper else ""]
        yield "| " + " | ".join(cells) + " |"


def set_rows(measured):
    for (rig, belt, operator, method), trials in measured.trials.items():
        if method != "paper" or not operator:
            continue
        cells = [f"`{rig}`", belt, spread([t.gate_lead_s for t in trials], "%+.2f s"),
                 spread([t.quiet_s for t in trials], "%.1f s")]
        cells += [spread([t.duration_s(n) for t in trials], "%.2f s") for n in (2, 3)]
        yield "| " + " | ".join(cells) + " |"


def reading_rows(measured):
    for number, options in enumerate(READINGS):
        text = ", ".join(f"`{k} = {v}`" for k, v in options.items()) or "the default"
        cells = [text]
        for belt in BELTS:
            trials = measured.readings[number, belt]
            cells += [count(t.by_itself for t in trials), count(t.in_order for t in trials),
                      spread([t.error_percent for t in trials], "%+.2f %%"),
                      spread([t.delay_s for t in trials], "%+.2f s")]
        yield "| " + " | ".join(cells) + " |"


def crossing_s(trial, slip_percent):
    return next((r.t_s for r in trial.rows if r.slip >= slip_percent), None)


def noise_percent(trial):
    """Standard deviation of slip between neighbouring seconds of the quiet run."""
    slips = [r.slip for r in trial.rows if 20.0 <= r.t_s < 60.0]
    parts = [slips[i:i + 200] for i in range(0, len(slips) - 199, 200)]
    return statistics.fmean(statistics.pstdev(part) for part in parts)


def comparison(measured):
    damaging, slow, before, after = measured.shown
    gate_s = damaging.open_rows()[0].t_s
    least_slip, mu_esc = measured.escape["new"]
    quick_noise, slow_noise = noise_percent(damaging), noise_percent(slow)

    def value(trial):
        return f"{trial.mu_max:.3f}" if trial.mu_max is not None else "none"

    def stopped(trial):
        return (f"the method says stop at {trial.slip_percent:.1f} % of slip, the operator lets go "
                f"{1000.0 * (trial.let_go_s - trial.stop_s):.0f} ms later; at most "
                f"{trial.most_slip_percent:.1f} % until the force is back")

    rows = (
        ("4", "slip* has a minimum; below it deformation dominates, above it macro slip",
         f"least slip* {least_slip:.2f} % at mu* = {mu_esc:.3f}"),
        ("5", "low-pass of 5 Hz and 1 Hz; the signal-to-noise ratio is relatively low at low slip; "
         "more slip than the estimate needs",
         f"slip within a second: {quick_noise:.3f} % and {slow_noise:.3f} %; slip up to "
         f"{max(r.slip for r in damaging.rows):.0f} %"),
        ("6", "\"during the first 85 s the friction\" (the copy breaks off here); macro slip after "
         "90 s", f"gate open from {gate_s:.1f} s on, peak at {damaging.peak_s:.1f} s, 10 % of "
         f"slip at {crossing_s(damaging, 10.0) or float('nan'):.1f} s"),
        ("7", "sets (1) to (4) along the curve; mu_max 0.105, reasonable by visual inspection",
         f"in order: {'yes' if damaging.in_order else 'no'}; mu_max {value(damaging)}"),
        ("8", "stopped in time, no excessive slip; mu_max 0.105",
         f"mu_max {value(before)}; {stopped(before)}"),
        ("9", "after the damage, the form has changed; mu_max 0.100",
         f"mu_max {value(after)}; {stopped(after)}"),
    )
    return "\n".join(f"| {a} | {b} | {c} |" for a, b, c in rows)


def document(measured):
    differ = [a.mu_max - b.mu_max for a, b in zip(*(
        measured.trials[RIGS[0], belt, True, "paper"] for belt in BELTS))]
    escapes = ", ".join(f"{belt} {mu:.3f} (mu_max {REPORTED[belt]:.3f})"
                        for belt, (_, mu) in measured.escape.items())
    return f"""# The paper's experiments, on our rig
Van Berkel, Fujii, Hofman, Steinbuch, "Belt-Pulley Friction Estimation for the Continuously Variable Transmission", CDC-ECC 2011. Method: `estimator/METHOD.md`, section 3. The paper's measured curves are not to be had: beside our curves stands what its text says of its own.

Written by `tests/statistics/paper/paper_document.py build/bin/beltgrip . --write`; `ctest --test-dir build -R paper_document` compares.

## The rig
`paper-figures` (`tools/scenarios/paper-figures.toml`) is the paper's rig as far as the text gives it: speed, torque, ratio, ramp, rates, filter, Table I, the friction before and after the damage, and the times. What the file marks "assumed" the text does not say: the forms of the two friction curves, the inertia of the load machine, the noise of the speeds, when the operator lets go and how fast the force is back. Nor does it say what is as in `paper-rig`: deformation, pulleys and piston, drag, the noise of torque and pressure, the force at the start. They were chosen, with the seeds 1 to 8, so that what the text says comes about: this shows that the paper's figures are possible, not that its belt was like this one.
`paper-rig` is the harder rig of this project: a corner at the peak (2 and 2.4 % of slip), ten times the inertia. There the gate opens after the peak, and the method is late and low.

![Figures 4 to 9](paper_figures.svg)

| figure | what the paper's text says | our run, seed {FIRST_SEED} |
|---|---|---|
{comparison(measured)}

## Both methods on both rigs
Seeds {FIRST_SEED} to {FIRST_SEED + len(differ) - 1}; the scenario was chosen with others (1 to 8). "Operator": the simulation's operator, who lets go at 6 % (`paper-figures`) or 10 % (`paper-rig`) of slip, after a reaction time; without him the force goes on falling (`--set operator.action=none`). Only a stop before he lets go counts as the method's own. Three figures: least / mean / greatest.

| rig | belt, mu_max | operator | method | own stop | mu_max | error | own stop after the peak | slip at the own stop | truth in 95 % interval | sets (2), (3), (4) in order |
|---|---|---|---|---|---|---|---|---|---|---|
{chr(10).join(result_rows(measured))}

"Paper, as before": the reading of the last row below; without the operator its stop on `paper-rig` is later still, with him it mostly comes after he has let go. `robust` takes a top that rises by less than about 1e-3 per percent for level: on `paper-figures` it ends before the peak, and what is still to come makes its interval too wide for a value: mostly a lower bound (why: `estimator/ACCURACY.md`, Known limits).

The two belts of `paper-figures` differ by {spread(differ, "%.4f")} in mu_max, seed by seed (method `paper`); the paper tells them apart as 0.105 and 0.100.

| rig | belt | gate opens before the peak | set (1): quiet until | set (2) lasts | set (3) lasts |
|---|---|---|---|---|---|
{chr(10).join(set_rows(measured))}

"In order": each set begins, and has its middle, after the one before. Noise can take single samples back.

## Readings that the text leaves open
The copy of the paper that is to be had breaks off between "so q_k" and "90 s)": initial state, what happens while the gate is closed and the mean's set are not said. They are options of `[estimator]` with `method = "paper"`; the default reproduces what the text reports best. `paper-figures`, operator lets go, the same seeds; the last row, "as before", is what was the default.

| reading | new: own stop | in order | error | after the peak | worn: own stop | in order | error | after the peak |
|---|---|---|---|---|---|---|---|---|
{chr(10).join(reading_rows(measured))}

Percent or fraction: `c_v` in fractions would ask for slip that runs at 77 % a second; slip is in percent everywhere.

## Equations that the estimator does not use
- (4), the friction of each pulley by its own torque: the primary's is (5) with the primary force, which the paper does not use either. The secondary's needs a torque sensor on the secondary shaft. Where one is there, (4) over (5) is the torque that arrives: {measured.secondary:.3f} in the mean of the first 60 s here, the rest is drag and deformation. This is the balance that `diagnose` fits (effect `secondary_loss`). For mu_max it would carry these losses into the value, and MinClampForce is asked for by the primary torque: not used.
- (7) and (8), the friction mu_esc at the least slip*: seed {FIRST_SEED}, means over 2 s: {escapes}. With deformation as on this rig it lies far below mu_max, moves with the pulleys' stiffness rather than with friction, and the least slip* says where the ratio stands against its end stop. That place serves: `calibrate` takes the end stop's ratio from the quiet cells there, as a line in force and mu*, which needs no minimum. As a measure of friction the paper itself leaves it ("the relation between mu_esc and the maximum friction is not clear"): not used.
"""


NUMBER = re.compile(r"none|[-+]?\d+(?:\.\d+)?|(?<=: )(?:yes|no)(?=;)")


SPREAD = re.compile(r"#(?: [%s])?(?: / #(?: [%s])?){2}")


def form(text):
    return SPREAD.sub("#", NUMBER.sub("#", text))


def form_of_picture(text):
    """Without the curves, whose stretches are as long as noise will have them."""
    text = re.sub(r'<path d="M[^"]* [^"]*" stroke="#[0-9a-f]*" stroke-width="[\d.]*" fill="none"/>',
                  "", text)
    return form(re.sub(r"\n+", "\n", text))


def ranges_of(text):
    """(rig, belt, operator, method) -> ranges of error and delay, as the document tells them, and
    whether most runs have a value whose interval holds the truth."""
    out = {}
    for line in text.splitlines():
        cells = [c.strip() for c in line.strip("|").split("|")]
        if len(cells) != 11 or not cells[0].startswith("`"):
            continue
        key = (cells[0].strip("`"), cells[1].split(",")[0], cells[2] != "none", cells[3].strip("`"))
        out[key] = [[float(v) for v in re.findall(r"[-+]?\d+\.\d+", cells[i])] for i in (6, 7)]
        held, of = (int(n) for n in cells[9].split(" of "))
        out[key].append(2 * held > of)
    return out


def outside(measured, text):
    """What lies outside the document's ranges, beyond its rounding."""
    ranges = ranges_of(text)
    for key, trials in measured.trials.items():
        for trial in trials:
            *stated_ranges, is_usual = ranges.get(key, ([], [], False))
            if trial.error_percent is None and is_usual:
                yield f"PAPER.md: {key}: found no value, the document has mostly values"
            for value, stated in zip((trial.error_percent, trial.delay_s), stated_ranges):
                if value is None:
                    continue
                if not stated or not stated[0] - 0.02 <= value <= stated[2] + 0.02:
                    yield f"PAPER.md: {key}: found {value:.3f}, the document says {stated}"


def broken(measured):
    """What is promised of the default reading on paper-figures, and of the robust method."""
    for (rig, belt, _, method), trials in measured.trials.items():
        name = f"{rig}, {belt}, {method}"
        if method == "robust":
            if rig == "paper-rig" and not all(t.by_itself and abs(t.error_percent) <= MEAN_ERROR_MAX_PERCENT for t in trials):
                yield f"{name}: not stopped, or off by more than {MEAN_ERROR_MAX_PERCENT} %"
        elif rig == RIGS[0]:
            if not all(t.by_itself and t.in_order and t.gate_lead_s > 0.0 and
                       abs(t.delay_s) <= DELAY_MAX_S for t in trials):
                yield f"{name}: no own stop, gate after the peak, sets not in order, or late"
            elif max(abs(t.error_percent) for t in trials) > ERROR_MAX_PERCENT:
                yield f"{name}: off by more than {ERROR_MAX_PERCENT} %"
            elif (len(trials) == SEEDS and abs(statistics.fmean(t.error_percent for t in trials))
                  > MEAN_ERROR_MAX_PERCENT):
                yield f"{name}: in the mean off by more than {MEAN_ERROR_MAX_PERCENT} %"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    parser.add_argument("source", type=Path)
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    document_path = given.source / "estimator/PAPER.md"
    picture_path = given.source / "estimator/paper_figures.svg"
    measured = Measured(given.program, SEEDS if given.write else TRIED)
    text, drawn = document(measured), picture.svg(*measured.shown, measured.escape["new"], THRESHOLDS)
    wrong = list(broken(measured))
    if given.write:
        document_path.write_text(text)
        picture_path.write_text(drawn)
    else:
        written = document_path.read_text()
        wrong += list(outside(measured, written))
        if form(text) != form(written):
            wrong.append(f"{document_path}: not what is written now; --write writes it anew")
        if form_of_picture(drawn) != form_of_picture(picture_path.read_text()):
            wrong.append(f"{picture_path}: not what is drawn now; --write draws it anew")
    print("\n".join(wrong) or "as measured")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
