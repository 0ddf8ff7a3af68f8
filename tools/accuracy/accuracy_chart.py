"""Line charts as SVG, the same bytes for the same numbers. The error axis is logarithmic."""
import math
from html import escape

WIDTH, HEIGHT = 860, 470
LEFT, RIGHT, TOP, BOTTOM = 70, 640, 50, 410   # the field; names stand to its right
NAME_STEP = 17                                # least distance of two names


class Chart:
    def __init__(self, title, x_label, x_range, x_ticks, y_range, x_log=False):
        self.x_range, self.y_range, self.x_log = x_range, y_range, x_log
        self.names = []
        self.parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
            f'width="{WIDTH}" height="{HEIGHT}" font-family="sans-serif" font-size="13">',
            f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
            text(LEFT, 26, title, size=16)]
        for value, label in x_ticks:
            x = self.x(value)
            self.parts += [line(x, TOP, x, BOTTOM, "#e8e8e8"),
                           text(x, BOTTOM + 18, label, anchor="middle")]
        self.parts.append(text((LEFT + RIGHT) / 2, BOTTOM + 42, x_label, anchor="middle"))
        for power in range(round(math.log10(y_range[0])), round(math.log10(y_range[1])) + 1):
            for digit in range(1, 10):
                value = digit * 10 ** power
                if value <= y_range[1] * 1.001:
                    y = self.y(value)
                    self.parts.append(line(LEFT, y, RIGHT, y, "#d0d0d0" if digit == 1 else "#f2f2f2"))
            self.parts.append(text(LEFT - 8, self.y(10 ** power) + 4, f"{10 ** power:g}", "end"))
        self.parts.append(f'<text transform="translate(20 {(TOP + BOTTOM) / 2}) rotate(-90)" '
                          'text-anchor="middle">mean error of the centre, px</text>')
        self.parts.append(f'<rect x="{LEFT}" y="{TOP}" width="{RIGHT - LEFT}" '
                          f'height="{BOTTOM - TOP}" fill="none" stroke="#707070"/>')

    def x(self, value):
        low, high = self.x_range
        share = math.log(value / low) / math.log(high / low) if self.x_log else \
            (value - low) / (high - low)
        return LEFT + share * (RIGHT - LEFT)

    def y(self, value):
        low, high = self.y_range
        return BOTTOM - math.log(value / low) / math.log(high / low) * (BOTTOM - TOP)

    def curve(self, name, points, colour, width=1.5, dash="", dots=0.0):
        """Through (x, error) points; the name stands at the last one's height."""
        at = [(self.x(x), self.y(y)) for x, y in points]
        path = " ".join(f"{x:.2f},{y:.2f}" for x, y in at)
        dashes = f' stroke-dasharray="{dash}"' if dash else ""
        self.parts.append(f'<polyline points="{path}" fill="none" stroke="{colour}" '
                          f'stroke-width="{width}"{dashes}/>')
        if dots:
            self.parts += [f'<circle cx="{x:.2f}" cy="{y:.2f}" r="{dots}" fill="{colour}"/>'
                           for x, y in at]
        self.names.append((at[-1], name, colour))

    def level(self, name, value, colour, width=1.0, dash=""):
        self.curve(name, [(self.x_range[0], value), (self.x_range[1], value)], colour, width, dash)

    def band(self, name, low, high, colour):
        top, bottom = self.y(high), self.y(low)
        self.parts.append(f'<rect x="{LEFT}" y="{top:.2f}" width="{RIGHT - LEFT}" '
                          f'height="{bottom - top:.2f}" fill="{colour}" opacity="0.25"/>')
        self.names.append(((RIGHT, (top + bottom) / 2), name, colour))

    def svg(self):
        names = sorted(self.names)
        names.sort(key=lambda one: one[0][1])
        heights = spread([at[1] for at, _, _ in names], TOP, BOTTOM)
        for ((x, y), name, colour), height in zip(names, heights):
            self.parts += [line(x, y, RIGHT + 18, height, colour, 0.7),
                           text(RIGHT + 22, height + 4, name, fill=colour)]
        return "\n".join([*self.parts, "</svg>", ""])


def spread(heights, low, high):
    """Rising heights pushed apart until names do not touch."""
    out = list(heights)
    for _ in range(200):
        for i in range(len(out) - 1):
            short = NAME_STEP - (out[i + 1] - out[i])
            if short > 0:
                out[i] -= short / 2
                out[i + 1] += short / 2
        out[0] = max(out[0], low)
        out[-1] = min(out[-1], high)
    return out


def line(x1, y1, x2, y2, colour, width=1.0):
    return (f'<line x1="{x1:.2f}" y1="{y1:.2f}" x2="{x2:.2f}" y2="{y2:.2f}" stroke="{colour}" '
            f'stroke-width="{width}"/>')


def text(x, y, words, anchor="start", size=13, fill="#202020"):
    return (f'<text x="{x:.2f}" y="{y:.2f}" text-anchor="{anchor}" font-size="{size}" '
            f'fill="{fill}">{escape(words)}</text>')
