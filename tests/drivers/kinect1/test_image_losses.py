"""The loss monitor warns once per window, and clears the warning."""

from drivers.kinect1.transport.image_losses import CONDITION, WINDOW_NS, ImageLosses


def test_the_warning_is_raised_and_cleared() -> None:
    now_ns, reports = 0, []
    monitor = ImageLosses(lambda: now_ns, lambda condition, message: reports.append((condition, message)))
    monitor.update(100, 100)  # too early to judge
    assert reports == []
    for delivered, dropped in ((580, 20), (1120, 80), (1700, 100), (2300, 100)):
        now_ns += WINDOW_NS
        monitor.update(delivered, dropped)
    assert [condition for condition, _ in reports] == [CONDITION] * 2
    assert "60 of 600 images" in reports[0][1]
    assert "USB controller" in reports[0][1]
    assert reports[1][1] == ""
