"""Judges scores by what their rows must reach, and writes the table."""
from accuracy_conditions import FOUND_3PX, FOUND_4PX, HONEST

SHARE_MIN_COUNT = 30  # fewer circles than this say nothing about a share


def judgements(row, score):
    """[(what, figure, bound in words, is it met)] of one row."""
    out = [("wrong ids", score.wrong_ids, "0", score.wrong_ids == 0)]
    if row.empty:
        return out
    out.append(("off by more than 0.3 px", score.far_off, "0", score.far_off == 0))
    for size, least, words in ((4, FOUND_4PX, "found of 4 px and more"),
                               (3, FOUND_3PX, "found of 3 to 4 px")):
        if row.dense and score.visible[size] >= SHARE_MIN_COUNT:
            share = score.found_share(size)
            out.append((words, share, f">= {least}", share >= least))
    if row.dense or score.measured:
        ratio, rms, honesty = score.ratio(), score.rms_px(), score.honesty()
        if row.ratio_max is not None:
            out.append(("ratio to the limit", ratio, f"<= {row.ratio_max:g}",
                        ratio is not None and ratio <= row.ratio_max))
        if row.rms_max_px is not None:
            out.append(("RMS px", rms, f"<= {row.rms_max_px:g}",
                        rms is not None and rms <= row.rms_max_px))
        out.append(("error / sigma", honesty, f"{HONEST[0]:g} to {HONEST[1]:g}",
                    honesty is not None and HONEST[0] <= honesty <= HONEST[1]))
    return out


def missed(row, score):
    return [f"{what} {number(figure)} ({bound})" for what, figure, bound, good in
            judgements(row, score) if not good]


def number(value):
    if value is None:
        return "none"
    return str(value) if isinstance(value, int) else f"{value:.4f}"


def percent(share):
    return "" if share is None else f"{100 * share:.2f} %"


def fixed(value, digits):
    return "" if value is None else f"{value:.{digits}f}"


HEAD = ["condition", "frames", ">= 4 px", "found", "3 to 4 px", "found", "wrong ids", "> 0.3 px",
        "worst px", "RMS px", "limit px", "ratio", "required", "error / sigma", "verdict"]


def cells(row, score):
    required = "" if row.empty else "-"
    if row.ratio_max is not None:
        required = f"<= {row.ratio_max:g}"
    elif row.rms_max_px is not None:
        required = f"<= {row.rms_max_px:g} px"
    return [row.name, str(score.frames), str(score.visible[4]), percent(score.found_share(4)),
            str(score.visible[3]), percent(score.found_share(3)), str(score.wrong_ids),
            str(score.far_off), fixed(score.worst_px, 3) if score.matched else "",
            fixed(score.rms_px(), 4), fixed(score.limit_px(), 4), fixed(score.ratio(), 2), required,
            fixed(score.honesty(), 2), "MISSED" if missed(row, score) else "ok"]


def aligned(lines):
    """Markdown rows with columns under each other."""
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    out = ["| " + " | ".join(cell.ljust(width) if i == 0 else cell.rjust(width)
                             for i, (cell, width) in enumerate(zip(line, widths))) + " |"
           for line in lines]
    rule = "|" + "|".join("-" * (w + 2) if i == 0 else "-" * (w + 1) + ":"
                          for i, w in enumerate(widths)) + "|"
    return [out[0], rule, *out[1:]]


def table(results):
    """Lines of the whole table: a line in bold opens each group of rows."""
    lines, group = [HEAD], None
    for row, score in results:
        if row.group != group:
            group = row.group
            lines.append([f"**{group}**"] + [""] * (len(HEAD) - 1))
        lines.append(cells(row, score))
    return aligned(lines)


def missed_lines(results):
    return [f"{row.group}, {row.name}: {'; '.join(missed(row, score))}"
            for row, score in results if missed(row, score)]
