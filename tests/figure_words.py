"""What can be read on a matplotlib figure: the boxes of its words, and whether they keep out of each other's way."""

from __future__ import annotations

from itertools import combinations

import matplotlib.text


def words(figure):
    """Boxes in pixels of the texts that are seen; ticks beyond the axes are not."""
    renderer = figure.canvas.get_renderer()
    ticks = {id(t) for ax in figure.axes for axis in (ax.xaxis, ax.yaxis) for t in axis.get_majorticklabels()}
    texts = [t for t in figure.findobj(matplotlib.text.Text) if id(t) not in ticks]
    for ax in figure.axes:
        for axis in (ax.xaxis, ax.yaxis):
            low, high = sorted(axis.get_view_interval())
            texts += [tick.label1 for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
    seen = [(t.get_text(), t.get_window_extent(renderer)) for t in texts if t.get_visible() and t.get_text().strip()]
    return [(text, box) for text, box in seen if box.width > 0 and box.height > 0]


def assert_words_apart(figure, at_least=10):
    """No word leaves the figure or overlaps another; the words, so that a test can ask for more."""
    figure.canvas.draw()
    width, height = figure.get_size_inches() * figure.dpi
    seen = words(figure)
    assert len(seen) > at_least
    for text, box in seen:
        assert box.x0 > -1 and box.x1 < width + 1 and box.y0 > -1 and box.y1 < height + 1, text
    for (one, a), (other, b) in combinations(seen, 2):
        across = min(a.x1, b.x1) - max(a.x0, b.x0)
        along = min(a.y1, b.y1) - max(a.y0, b.y0)
        assert across <= 1.0 or along <= 1.0, (one, other)
    return [text for text, _ in seen]
