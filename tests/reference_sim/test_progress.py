"""Time left of long work."""

import io

from reference_sim.command_line import BELIEVED_SHARE, LEAST, announce_compilation, progress_bar


def _time_left(*, done, seconds, **options):
    bar = progress_bar(total=3600.0, file=io.StringIO(), **options)
    bar.update(done)
    bar.start_t -= seconds
    shown = bar.format_dict
    bar.close()
    return (shown["total"] - shown["n"]) / shown["rate"]


def test_time_left_is_known_before_a_task_has_ended():
    assert abs(_time_left(done=0.0, seconds=0.0, expected_rate=2.0) - 1800.0) < 1.0
    early = _time_left(done=1.0, seconds=30.0, expected_rate=2.0)
    assert 1800.0 < early < 1.3 * 1800.0


def test_time_left_follows_what_is_measured_in_the_end():
    hour = 3600.0
    measured = (hour - 1800.0) / 0.5  # half of the work in an hour: twice as slow as expected of one worker
    left = _time_left(done=1800.0, seconds=hour, expected_rate=1.0)
    assert measured / (1.0 + 2.0 * BELIEVED_SHARE) < left < measured


def test_time_left_falls_as_time_goes_by_while_a_long_task_reports_nothing():
    assert abs(_time_left(done=0.0, seconds=300.0, expected_rate=1.0) - 3300.0) < 1.0
    assert abs(_time_left(done=0.0, seconds=4000.0, expected_rate=1.0) - LEAST * 3600.0) < 1.0


def test_time_left_falls_between_two_reports():
    bar = progress_bar(total=3600.0, file=io.StringIO(), expected_rate=1.0)
    bar.update(600.0)
    left = []
    for _ in range(2):
        bar.start_t -= 500.0
        shown = bar.format_dict
        left.append((shown["total"] - shown["n"]) / shown["rate"])
    bar.close()
    assert abs(left[0] - left[1] - 500.0) < 1.0


def test_compilation_is_announced_where_no_compiled_kernel_lies_on_disk(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    announce_compilation()
    assert capsys.readouterr().err.startswith("first use: kernels are compiled")
    folder = tmp_path / "reference_sim.kernels.fast_kernels-0123456789abcdef"
    folder.mkdir()
    (folder / "sweep-1.py311.nbi").touch()
    announce_compilation()
    assert capsys.readouterr().err == ""
