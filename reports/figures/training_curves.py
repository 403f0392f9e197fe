"""Training curves: loss against training time, a panel for each kind of loss."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from reports.figures.figure import Drawing
from reports.figures.method_styles import leading, style
from reports.figures.plotting import file_name, fit, log_axis, new_panels
from reports.run.finished_run import Run
from reports.run.training_histories import PANELS, History


def training_curves(run: Run) -> Iterator[Drawing]:
    """Draw the loss of every training, a figure for each garment, the first under the plain name."""
    for place, garment in enumerate(dict.fromkeys(history.garment for history in run.histories)):
        name = f"training_{file_name(garment)}" if place else "training"
        histories = [history for history in run.histories if history.garment == garment]
        shown = leading(run, {history.method for history in histories})
        histories = [history for history in histories if history.method in shown]
        if histories:
            yield _draw_garment(run, name, garment, histories)


def _draw_garment(run: Run, name: str, garment: str, histories: Sequence[History]) -> Drawing:
    known = dict.fromkeys((*PANELS.values(), *(h.panel for h in histories)))
    titles = [title for title in known if any(h.panel == title for h in histories)]
    figure, panels = new_panels(len(titles), 2)
    for axes, title in zip(panels, titles):
        of_panel = [history for history in histories if history.panel == title]
        for history in of_panel:
            look, seconds = style(run, history.method), history.column("seconds")
            axes.plot(seconds, history.column("loss"), color=look.colour, linestyle=look.line, linewidth=1.1)
        axes.set(xlabel="training time [s]", title=title)
        # Gravity may make losses negative.
        if min(history.column("loss").min() for history in of_panel) > 0.0:
            log_axis(axes, "y")
    shown = leading(run, {history.method for history in histories})
    fit(figure, [style(run, method) for method in shown])
    caption = f"{garment}: training loss against wall time; one curve per model and seed."
    return Drawing(figure, name, caption)
