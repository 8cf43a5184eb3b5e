"""The picture of a diagnosis: measured against simulated, before and after.

    pliant diagnose --json > diagnosis.json
    python validation/picture.py diagnosis.json docs/diagnosis.svg

Left: the rope at the instant of the largest baseline error of the first record shown, from the
side. Right: one coordinate of one marker over time. Every point comes from the diagnosis.
"""

import argparse
import json
from html import escape
from pathlib import Path

WIDTH, HEIGHT = 860, 360
TOP, BOTTOM = 56, 310
LEFT_PANEL, RIGHT_PANEL = (20, 400), (480, 840)
BEFORE, AFTER, MEASURED, TEXT = "#d95f02", "#1b6ca8", "#222222", "#444444"


def side_view(points):
    """Horizontal x and height z of points, in metres."""
    return [(p[0], p[2]) for p in points]


def fit(points, panel, equal):
    """A map from data to the panel; `equal` keeps the scales of both axes the same."""
    xs, ys = zip(*points, strict=True)
    width, height = panel[1] - panel[0], BOTTOM - TOP
    sx = width / ((max(xs) - min(xs)) or 1.0)
    sy = height / ((max(ys) - min(ys)) or 1.0)
    if equal:
        sx = sy = min(sx, sy)
    left = panel[0] + (width - sx * (max(xs) - min(xs))) / 2
    base = BOTTOM - (height - sy * (max(ys) - min(ys))) / 2
    x0, y0 = min(xs), min(ys)
    return lambda p: (left + sx * (p[0] - x0), base - sy * (p[1] - y0)), sx


def line(points, colour, dashed=False):
    """A polyline through pixels."""
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    dash = ' stroke-dasharray="7 4"' if dashed else ""
    return f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2.2"{dash}/>'


def dots(points, radius):
    """Filled circles at pixels."""
    return "".join(
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" fill="{MEASURED}"/>' for x, y in points
    )


def text(x, y, words, colour=TEXT, size=13, anchor="start", weight="normal"):
    """A line of text."""
    return (
        f'<text x="{x}" y="{y}" fill="{colour}" font-size="{size}" text-anchor="{anchor}" '
        f'font-weight="{weight}">{escape(words)}</text>'
    )


def shapes(snapshot):
    """The rope at one instant."""
    measured, before, after = (side_view(snapshot[k]) for k in ("measured", "before", "after"))
    place, scale = fit(measured + before + after, LEFT_PANEL, equal=True)
    right = LEFT_PANEL[1]
    return [
        text(LEFT_PANEL[0], 24, f"{snapshot['record']}, the rope at t = {snapshot['time']:.2f} s", weight="bold"),
        line(map(place, before), BEFORE, dashed=True),
        line(map(place, after), AFTER),
        dots(map(place, measured), 4.5),
        f'<line x1="{right - 0.1 * scale:.1f}" x2="{right}" y1="335" y2="335" stroke="{TEXT}"/>',
        text(right, 352, "100 mm", anchor="end", size=12),
    ]


def over_time(curve):
    """The coordinate of a marker in which the baseline errs most."""

    def error(axis):
        pairs = zip(curve["before"], curve["measured"], strict=True)
        return sum((b[axis] - m[axis]) ** 2 for b, m in pairs)

    axis = max(range(3), key=error)
    series = {
        key: [(t, p[axis]) for t, p in zip(curve["time"], curve[key], strict=True)]
        for key in ("measured", "before", "after")
    }
    everything = [point for points in series.values() for point in points]
    place, _ = fit(everything, RIGHT_PANEL, equal=False)
    values = [y for _, y in everything]
    left, right = RIGHT_PANEL
    end = curve["time"][-1]
    return [
        text(left, 24, f"marker {curve['marker'] + 1}, coordinate {'xyz'[axis]}", weight="bold"),
        dots(map(place, series["measured"][::3]), 2.2),
        line(map(place, series["before"]), BEFORE, dashed=True),
        line(map(place, series["after"]), AFTER),
        f'<line x1="{left}" x2="{right}" y1="{BOTTOM + 8}" y2="{BOTTOM + 8}" stroke="{TEXT}"/>',
        text(left, BOTTOM + 24, "0", size=12),
        text(right, BOTTOM + 24, f"{end:.1f} s", anchor="end", size=12),
        text(left - 6, TOP + 6, f"{1e3 * max(values):.0f} mm", anchor="end", size=12),
        text(left - 6, BOTTOM, f"{1e3 * min(values):.0f} mm", anchor="end", size=12),
    ]


def legend(diagnosis):
    """What the colours mean, with the errors on held-out records."""
    longest = diagnosis["gain"][-1]
    before, after = (f"{1e3 * longest[k]:.1f} mm" for k in ("rmse_before", "rmse_after"))
    name = " + ".join(cause["name"].replace("_", " ") for cause in diagnosis["causes"])
    return [
        text(20, 44, "● measured", MEASURED),
        text(112, 44, f"- - before: {before} RMS", BEFORE),
        text(272, 44, f"— with {name}: {after} RMS", AFTER),
    ]


def main():
    """Reads a diagnosis, writes the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("diagnosis", type=Path, help="JSON of `pliant diagnose --json`")
    parser.add_argument("picture", type=Path, help="SVG to write")
    arguments = parser.parse_args()
    diagnosis = json.loads(arguments.diagnosis.read_text())
    parts = [*shapes(diagnosis["snapshots"][0]), *over_time(diagnosis["curves"][0]), *legend(diagnosis)]
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" '
        f'height="{HEIGHT}" font-family="system-ui, sans-serif">'
    )
    body = "\n".join([head, f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>', *parts, "</svg>"])
    arguments.picture.write_text(body + "\n")


if __name__ == "__main__":
    main()
