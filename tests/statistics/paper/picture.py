"""Figures 4 to 9 of the paper, drawn from our runs: one SVG."""

import statistics

COLOURS = {1: "#9aa0a6", 2: "#1f77b4", 3: "#2ca02c", 4: "#d62728"}
GAP = 8  # samples between two drawn points; in set (1) eight times as many
MEAN_PERCENT, MEAN_S = 0.15, 2.0  # a point of Figure 4


class Panel:
    def __init__(self, x, y, width, height, x_range, y_range, title, x_label, y_label):
        self.box = (x, y, width, height)
        self.x_range, self.y_range = x_range, y_range
        self.parts = [f'<rect x="{x}" y="{y}" width="{width}" height="{height}" fill="none" '
                      'stroke="#444"/>',
                      f'<text x="{x}" y="{y - 6}" class="t">{title}</text>']
        if x_label:
            self.parts.append(f'<text x="{x + width / 2:.0f}" y="{y + height + 28}" '
                              f'text-anchor="middle">{x_label}</text>')
        middle = y + height / 2
        self.parts.append(f'<text x="{x - 40}" y="{middle:.0f}" text-anchor="middle" '
                          f'transform="rotate(-90 {x - 40} {middle:.0f})">{y_label}</text>')

    def at(self, u, v):
        x, y, width, height = self.box
        share_x = (u - self.x_range[0]) / (self.x_range[1] - self.x_range[0])
        share_y = (v - self.y_range[0]) / (self.y_range[1] - self.y_range[0])
        return x + width * share_x, y + height * (1.0 - share_y)

    def ticks(self, across, up):
        x, y, width, height = self.box
        for value in across:
            px, _ = self.at(value, self.y_range[0])
            self.parts.append(f'<path d="M{px:.1f} {y + height}v-4" stroke="#444"/>'
                              f'<text x="{px:.1f}" y="{y + height + 13}" text-anchor="middle">'
                              f'{value:g}</text>')
        for value in up:
            _, py = self.at(self.x_range[0], value)
            self.parts.append(f'<path d="M{x} {py:.1f}h4" stroke="#444"/>'
                              f'<text x="{x - 4}" y="{py + 3:.1f}" text-anchor="end">{value:g}</text>')

    def level(self, value, colour="#444", dash="3 3"):
        (left, y), (right, _) = (self.at(u, value) for u in self.x_range)
        self.parts.append(f'<path d="M{left:.0f} {y:.1f}H{right:.0f}" stroke="{colour}" '
                          f'stroke-dasharray="{dash}" fill="none"/>')

    def line(self, points, colour, width=1.0):
        """What lies outside of the panel is left out."""
        pieces = [[]]
        for u, v in points:
            if self.x_range[0] <= u <= self.x_range[1] and self.y_range[0] <= v <= self.y_range[1]:
                pieces[-1].append(self.at(u, v))
            elif pieces[-1]:
                pieces.append([])
        for piece in pieces:
            if len(piece) > 1:
                path = " ".join(f"{px:.1f} {py:.1f}" for px, py in piece)
                self.parts.append(f'<path d="M{path}" stroke="{colour}" stroke-width="{width}" '
                                  'fill="none"/>')

    def point(self, u, v, text):
        px, py = self.at(u, v)
        self.parts.append(f'<circle cx="{px:.1f}" cy="{py:.1f}" r="3" fill="#000"/>')
        self.label(u + 0.02 * (self.x_range[1] - self.x_range[0]), v, text)

    def label(self, u, v, text, colour="#000"):
        px, py = self.at(u, v)
        self.parts.append(f'<text x="{px:.0f}" y="{py:.0f}" fill="{colour}">{text}</text>')


def runs_of_sets(rows):
    """Unbroken stretches of one set, thinned, each with the point that the next one begins with."""
    out = []
    for row in rows:
        if not out or out[-1][0] != row.set:
            if out:
                out[-1][1].append(row)
            out.append((row.set, []))
        out[-1][1].append(row)
    for number, part in out:
        gap = 8 * GAP if number == 1 else GAP
        kept = part[::gap]
        if kept[-1] is not part[-1]:
            kept.append(part[-1])
        yield number, kept


def draw_sets(panel, rows, x, y):
    for number, part in runs_of_sets(rows):
        panel.line([(x(r), y(r)) for r in part], COLOURS[number], 1.4)


def curve(x, y, title, trial, rows, names):
    panel = Panel(x, y, 250, 170, (0.0, 12.0), (0.06, 0.115), title, "&#963;* [%]", "&#956;*")
    panel.ticks((0, 2, 4, 6, 8, 10, 12), (0.06, 0.08, 0.1))
    draw_sets(panel, rows, lambda r: r.slip, lambda r: r.mu)
    if trial.mu_max is not None:
        panel.level(trial.mu_max, "#000", "6 3")
        panel.label(0.3, trial.mu_max + 0.0015, f"mu_max {trial.mu_max:.3f}")
    for number, (u, v) in names.items():
        panel.label(u, v, f"({number})", COLOURS[number])
    return panel


def means(rows):
    """(slip, mu) in means, each as long as slip takes to move on by MEAN_PERCENT, or MEAN_S."""
    part = []
    for row in rows:
        part.append(row)
        if row.t_s - part[0].t_s > MEAN_S or abs(row.slip - part[0].slip) > MEAN_PERCENT:
            yield tuple(statistics.fmean(v) for v in zip(*((r.slip, r.mu) for r in part)))
            part = []


def schematic(x, y, rows, escape):
    """Figure 4: the minimum of slip*, and the top."""
    panel = Panel(x, y, 250, 170, (1.0, 7.0), (0.055, 0.115), "Fig. 4: the damaging run, in means",
                  "&#963;* [%]", "&#956;*")
    panel.ticks((1, 2, 3, 4, 5, 6, 7), (0.06, 0.08, 0.1))
    points = list(means(rows))
    panel.line(points, "#000")
    panel.point(*escape, "mu_esc")
    top = max(points, key=lambda each: each[1])
    panel.point(*top, "")
    panel.label(top[0] - 0.5, top[1] + 0.003, "mu_max")
    return panel


def slip_curve(x, y, quick, slow):
    panel = Panel(x, y, 250, 170, (0.0, 12.0), (0.06, 0.115), "Fig. 5: low-pass 5 Hz (grey), 1 Hz",
                  "&#963;* [%]", "&#956;*")
    panel.ticks((0, 2, 4, 6, 8, 10, 12), (0.06, 0.08, 0.1))
    panel.line([(r.slip, r.mu) for r in quick[::GAP]], "#bbb")
    panel.line([(r.slip, r.mu) for r in slow[::GAP]], "#000")
    return panel


def courses(x, rows, mu_max, thresholds):
    """Figure 6, from top to bottom."""
    kinds = (("&#956;*", lambda r: r.mu, (0.06, 0.12), (0.08, 0.1), ()),
             ("&#963;* [%]", lambda r: r.slip, (0.0, 25.0), (0, 10, 20), ()),
             ("v [%&#178;]", lambda r: r.variance, (0.0, 0.5), (0, 0.25, 0.5), (thresholds["c_v"],)),
             ("k [1/%]", lambda r: r.slope, (-0.006, 0.02), (0, 0.01, 0.02),
              (thresholds["c_k"], thresholds["c_m"])))
    begin, end = 70.0, 95.0
    rows = [r for r in rows if begin <= r.t_s <= end]
    for i, (name, value, y_range, up, levels) in enumerate(kinds):
        panel = Panel(x, 40 + 160 * i, 300, 130, (begin, end), y_range,
                      "Fig. 6: the damaging run" if i == 0 else "", "t [s]" if i == 3 else "", name)
        panel.ticks((70, 75, 80, 85, 90, 95) if i == 3 else (), up)
        for each in levels:
            panel.level(each)
        draw_sets(panel, rows, lambda r: r.t_s, value)
        if i == 0 and mu_max is not None:
            panel.level(mu_max, "#000", "6 3")
        yield panel


def svg(damaging, slow, before, after, escape, thresholds):
    """Trials with their rows up to where the force comes back; (slip, mu) at the least slip*."""
    panels = list(courses(60, damaging.rows, damaging.mu_max, thresholds))
    panels.append(schematic(430, 40, slow.rows, escape))
    panels.append(slip_curve(740, 270, damaging.rows, slow.rows))
    places = {1: (2.6, 0.078), 2: (3.0, 0.094), 3: (5.0, 0.108), 4: (8.0, 0.087)}
    panels.append(curve(430, 270, "Fig. 7: the damaging run", damaging, damaging.rows, places))
    panels.append(curve(430, 500, "Fig. 8: stopped in time, new belt", before, before.rows, {}))
    panels.append(curve(740, 500, "Fig. 9: stopped in time, worn belt", after, after.rows, {}))
    key = "".join(f'<path d="M750 {60 + 18 * n}h24" stroke="{COLOURS[n]}" stroke-width="2"/>'
                  f'<text x="782" y="{64 + 18 * n}">({n}) {text}</text>'
                  for n, text in ((1, "gate closed: v &#8804; c_v"), (2, "k &gt; c_m"),
                                  (3, "|k| &lt; c_m: mu_max is their mean"),
                                  (4, "k &lt; c_k: stop")))
    return ('<svg xmlns="http://www.w3.org/2000/svg" width="1020" height="720" font-size="10" '
            'font-family="sans-serif">\n<style>.t{font-weight:bold}</style>\n'
            '<rect width="1020" height="720" fill="#fff"/>\n' + key + "\n" +
            "\n".join(part for panel in panels for part in panel.parts) + "\n</svg>\n")
